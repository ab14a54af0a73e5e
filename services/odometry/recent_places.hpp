// The last second of the way, at least its last two places, for speeds and spreads over a part of it.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

namespace railfix::odometry {

class RecentPlaces {
 public:
  struct Place {
    int64_t stamp_ns;
    double measured_m;
  };
  struct Spread {
    double mean_m = 0, rms_m = 0, range_m = 0;
  };
  RecentPlaces() { places_.reserve(kMost); }

  /// In the order of stamps.
  void remember(int64_t stamp_ns, double measured_m);
  /// All places lie so much farther on.
  void shift(double by_m);
  void forget() { places_.clear(); }
  [[nodiscard]] size_t count() const { return places_.size(); }
  /// Index of the first place that is not older than this against the newest. REQUIRES: one is remembered.
  [[nodiscard]] size_t since(int64_t age_ns) const;
  /// From place `first` to the newest.
  [[nodiscard]] int64_t span_ns(size_t first) const { return places_.back().stamp_ns - places_[first].stamp_ns; }
  /// REQUIRES: first < end <= count().
  [[nodiscard]] Spread spread(size_t first, size_t end) const;
  /// Mean over the shortest way to the newest place that lasted at least so long, else over all there is; 0 with one
  /// place. Over a few microseconds any error of the places would be a speed.
  [[nodiscard]] double speed_mps(int64_t least_ns) const;

 private:
  /// Of a second at 1000 Hz, the fastest camera that can be set.
  static constexpr size_t kMost = 1024;
  std::vector<Place> places_;
};

}  // namespace railfix::odometry
