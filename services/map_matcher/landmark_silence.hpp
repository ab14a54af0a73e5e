// Does the train pass what the map has without a sighting of any of it? Then the camera tells less than it should, and
// the interval grows without a reference, although every service seems well.
#pragma once

#include <map>
#include <optional>
#include <string>

#include "map_matcher/match_types.hpp"
#include "track/path.hpp"

namespace railfix::map_matcher {

class LandmarkSilence {
 public:
  /// The train is here on the path. Passed is what it runs over forwards, once, with the rails in sight: in darkness
  /// nobody expects a sighting.
  void run_on(const track::Path& path, double path_distance_m, bool rails_in_sight);
  /// Ends the silence where the map has a landmark of the kind in the window.
  void sight(const track::Path& path, const Sighting& sighting, const Prior& prior);
  /// Distances do not go on from those before, or nobody saw what was passed.
  void begin_way();
  /// What an operator should know; empty = nothing.
  [[nodiscard]] std::string trouble() const;

 private:
  void pass(const track::PathLandmark& landmark, double way_m);

  std::optional<double> reached_m_;  // on the path: what lies before it was passed
  std::optional<double> sighted_m_;  // on the path: what stands there was sighted, what is before it may have been
  std::map<track::LandmarkKind, double> last_of_kind_m_;  // on the path, of those that were passed
  double way_m_ = 0;                                      // forwards, since the last sighting
  int unsighted_ = 0;
  double first_m_ = 0, last_m_ = 0;  // of them, on that way
};

}  // namespace railfix::map_matcher
