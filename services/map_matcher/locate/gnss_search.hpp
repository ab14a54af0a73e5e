// Where on the network, by GNSS, long before the track has bent enough: the one track within its reach that runs as it
// sees the train move. Where several do, GNSS cannot tell them apart, and nothing is said.
#pragma once

#include <deque>
#include <memory>
#include <optional>
#include <vector>

#include "map_matcher/locate/network_index.hpp"

namespace railfix::map_matcher {

/// As fusion's parameters of the same names, which its interval is made of.
struct GnssSearchParameters {
  double bound_m = 30.0;         // GNSS that agrees with the odometer may be wrong by so much, ...
  double lag_s = 1.0;            // ... and its stamp by that
  double sigma_m = 3.0;          // at HDOP 1
  double most_hdop = 3.0;        // a fix that is vaguer says nothing
  double antenna_ahead_m = 0.0;  // of the camera's foot
  double interval_factor = 4.0;  // so many sigmas must hold the train
};

/// On the plane of the map.
struct GnssPosition {
  double easting_m = 0;
  double northing_m = 0;
  double hdop = 1;
};

/// Of the camera's foot at the last position, in the direction that it looks.
struct GnssPlace {
  track::EdgePosition place;
  double sigma_m = 0;
};

class GnssSearch {
 public:
  GnssSearch(const GnssSearchParameters& parameters, std::shared_ptr<const NetworkIndex> index)
      : parameters_(parameters), index_(std::move(index)) {}

  /// odometer_m: of the train then, forward growing; speed_mps: by which a late stamp errs.
  /// False for one that is too vague: it is left out, and nothing is known of where the train is now.
  bool add(const GnssPosition& position, double odometer_m, double speed_mps);
  /// Nothing before GNSS and odometer have agreed over some way, nor where no track or more than one is within reach.
  [[nodiscard]] std::optional<GnssPlace> place() const;
  /// So many tracks are within reach, as far as that is known.
  [[nodiscard]] std::optional<size_t> tracks() const;

 private:
  struct Seen {
    GnssPosition position;
    double odometer_m = 0;
    double run_m = 0;    // forward and back
    double reach_m = 0;  // so far from the track it may be at most
    double late_m = 0;   // ... and so much more along it
  };
  /// A track within reach on which the train may be; it fits where it lies beside the position and runs as the train.
  struct Near {
    track::EdgePosition place;
    bool fits = false;
  };
  /// Every position since the first is as far from it as the odometer says.
  [[nodiscard]] bool agrees() const;
  /// The heading of the train's front; nothing where GNSS does not agree with the odometer.
  [[nodiscard]] std::optional<double> heading_rad() const;
  [[nodiscard]] std::vector<Near> tracks_at(const Seen& seen, double heading_rad) const;
  void add_track(const track::NearTrack& near, const Seen& seen, double heading_rad, std::vector<Near>& tracks) const;
  [[nodiscard]] bool is_passed_again(const track::EdgePosition& place, const Seen& seen) const;
  [[nodiscard]] std::optional<track::EdgePosition> foot_behind(const track::EdgePosition& antenna) const;

  GnssSearchParameters parameters_;
  std::shared_ptr<const NetworkIndex> index_;
  std::deque<Seen> seen_;  // the last way, oldest first
};

}  // namespace railfix::map_matcher
