// What GNSS has said of the place not long ago, for the search of the map: of the ways that fit only those are left
// that were within its reach then, and one that is vague along the track is put where GNSS says.
#pragma once

#include <optional>

#include "map_matcher/locate/gnss_search.hpp"
#include "map_matcher/locate/measured_run.hpp"
#include "map_matcher/locate/way_fit.hpp"

namespace railfix::map_matcher {

class HeardPlace {
 public:
  /// The train has moved on by since_m since then (forward positive).
  void hear(const GnssReach& reach, double since_m);
  void move(double way_m);
  void forget() { heard_.reset(); }
  /// Nothing is held any more when the train has come far since, or was to and fro: then over which legs of switches
  /// is not known.
  [[nodiscard]] bool known() const { return heard_.has_value(); }
  /// So many places on the map, about 40 m apart, are within reach: each may fit by chance.
  [[nodiscard]] double places(const NetworkIndex& index) const;
  /// Rough: a candidate that is left out is not within reach. `bins` of the way lie behind its place. REQUIRES:
  /// known().
  [[nodiscard]] bool may_hold(const Candidate& candidate, size_t bins) const;
  /// A fit that was within reach, with what GNSS says of its place along the way; nothing otherwise. REQUIRES: known().
  [[nodiscard]] std::optional<WayFit> held(WayFit fit, const MeasuredRun& run) const;

 private:
  struct Heard {
    GnssReach reach;
    double since_m = 0;
    double run_m = 0;  // forward and back
  };
  std::optional<Heard> heard_;
};

}  // namespace railfix::map_matcher
