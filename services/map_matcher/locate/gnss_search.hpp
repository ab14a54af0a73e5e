// Where on the network, by GNSS, long before the track has bent enough: the one track within its reach that runs as it
// sees the train move. Where several do, GNSS cannot tell them apart, and nothing is said.
#pragma once

#include <cstdint>
#include <deque>
#include <memory>
#include <optional>
#include <vector>

#include "map_matcher/locate/network_index.hpp"

namespace railfix::map_matcher {

/// On the plane of the map.
struct GnssPosition {
  int64_t stamp_ns = 0;
  double easting_m = 0;
  double northing_m = 0;
};

class GnssSearch {
 public:
  /// So far from the track it may be at most; what lies further away is another track.
  static constexpr double kReachM = 30.0;
  /// One sigma along the track: four of them hold what GNSS may be wrong by unseen.
  static constexpr double kSigmaM = 10.0;

  explicit GnssSearch(std::shared_ptr<const NetworkIndex> index) : index_(std::move(index)) {}

  /// odometer_m: of the train at the stamp, forward growing.
  void add(const GnssPosition& position, double odometer_m);
  /// Where the front was at the last position, in the direction that it looks. Nothing before GNSS and odometer have
  /// agreed over some way, nor where no track or more than one is within reach.
  [[nodiscard]] std::optional<track::EdgePosition> place() const;
  /// So many tracks are within reach, as far as that is known.
  [[nodiscard]] std::optional<size_t> tracks() const;

 private:
  struct Seen {
    GnssPosition position;
    double odometer_m = 0;
    double run_m = 0;  // forward and back
  };
  /// Every position since the first is as far from it as the odometer says.
  [[nodiscard]] bool agrees() const;
  /// The heading of the train's front; nothing where GNSS does not agree with the odometer.
  [[nodiscard]] std::optional<double> heading_rad() const;
  [[nodiscard]] std::vector<track::EdgePosition> tracks_at(const GnssPosition& position, double heading_rad) const;
  [[nodiscard]] bool comes_from(const track::EdgePosition& place, const Seen& before) const;

  std::shared_ptr<const NetworkIndex> index_;
  std::deque<Seen> seen_;  // the last way, oldest first
};

}  // namespace railfix::map_matcher
