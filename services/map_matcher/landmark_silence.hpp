// Does the train pass what the map has without a sighting of any of it? Then the camera tells less than it should, and
// the interval grows without a reference, although every service seems well.
#pragma once

#include <optional>
#include <string>

#include "map_matcher/match_types.hpp"
#include "track/path.hpp"

namespace railfix::map_matcher {

class LandmarkSilence {
 public:
  /// The train is here on the path. Passed is only what it runs over forwards with the rails in sight: in darkness
  /// nobody expects a sighting.
  void run_on(const track::Path& path, double path_distance_m, bool rails_in_sight);
  /// Ends the silence where the map has a landmark of the kind in the window.
  void sight(const track::Path& path, const Sighting& sighting, const Prior& prior);
  /// Distances do not go on from those before.
  void begin_path() { here_m_.reset(); }
  /// What an operator should know; empty = nothing.
  [[nodiscard]] std::string trouble() const;

 private:
  std::optional<double> here_m_;
  int passed_ = 0;
  double way_m_ = 0;
};

}  // namespace railfix::map_matcher
