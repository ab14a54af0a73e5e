// Does the train stand?
#pragma once

#include <cmath>
#include <cstdint>

#include "core/time.hpp"

namespace railfix::fusion {

/// A plain value.
class Standstill {
 public:
  explicit Standstill(int64_t stamp_ns) : since_ns_(stamp_ns) {}
  void look(double distance_m, double speed_sigma_mps, int64_t stamp_ns) {
    if (std::abs(distance_m - distance_m_) > kRestM || speed_sigma_mps > kRestSpeedSigmaMps) {
      distance_m_ = distance_m;
      since_ns_ = stamp_ns;
    }
    stands_ = core::seconds(stamp_ns - since_ns_) >= kRestS;
  }
  /// What a place corrects is no way: a train that stands goes on standing.
  void corrected(double by_m) { distance_m_ += by_m; }
  void set_clock(int64_t stamp_ns) { since_ns_ = stamp_ns; }
  [[nodiscard]] bool stands() const { return stands_; }

 private:
  static constexpr double kRestM = 0.05;  // a train that moved less than this ...
  static constexpr double kRestS = 1.0;   // ... for so long stands still
  static constexpr double kRestSpeedSigmaMps = 0.3;
  double distance_m_ = 0;  // where it may have come to rest
  int64_t since_ns_;
  bool stands_ = false;
};

}  // namespace railfix::fusion
