#include "map_matcher/beside_doubt.hpp"

#include <algorithm>
#include <cmath>

namespace railfix::map_matcher {
namespace {

using track::LandmarkKind;

constexpr double kOneThingM = 30;   // what is so near together, balises of a group, the map has wrong together
constexpr double kOwnRailsM = 1.0;  // further to the side it is no train's own
constexpr double kMostOfOne = 20;   // maps err about single ones: three speak louder than any one
constexpr double kLeastOdds = 5e-5;
constexpr double kMostOdds = 99;          // less than would declare another leg for who begins with the rest
constexpr double kAlongsideCosine = 0.9;  // lines that cross are not beside

bool lies_in_track(LandmarkKind kind, double lateral_m) {
  return (kind == LandmarkKind::balise || kind == LandmarkKind::frog) && std::abs(lateral_m) < kOwnRailsM;
}

}  // namespace

void BesideDoubt::begin_anew() {
  odds_ = kTold;
  weighed_m_.reset();
}

// Where both tracks have one it says nothing, nor where neither has.
void BesideDoubt::sight(const track::Path& followed, const Sighting& sighting, const Prior& prior) {
  const double run_m = prior.travelled_m + sighting.distance_ahead_m;
  if (!lies_in_track(sighting.kind, sighting.lateral_m)) return;
  if (weighed_m_ && std::abs(run_m - *weighed_m_) < kOneThingM) return;
  const double place_m = prior.path_distance_m + sighting.distance_ahead_m;
  const double margin_m = parameters_.window_margin_m + parameters_.moved_m + 3 * sighting.sigma_m;
  const Window window{sighting.kind, prior.over_m + margin_m, prior.under_m + margin_m};
  const bool here = std::ranges::any_of(followed.landmarks_between(place_m - window.behind_m, place_m + window.ahead_m),
                                        [&](const track::PathLandmark& mark) {
                                          return mark.kind == window.kind && lies_in_track(mark.kind, mark.lateral_m);
                                        });
  if (here == is_beside(followed.map(), followed.position_at(place_m), window)) return;
  weighed_m_ = run_m;
  // It is anywhere in the window, or false.
  const double chance = parameters_.detection * sighting.confidence / (window.behind_m + window.ahead_m);
  const double ratio = std::min((parameters_.false_per_m + chance) / parameters_.false_per_m, kMostOfOne);
  odds_ = std::clamp(here ? odds_ / ratio : odds_ * ratio, kLeastOdds, kMostOdds);
}

bool BesideDoubt::is_beside(const track::Map& map, const track::EdgePosition& place, const Window& window) const {
  const double heading_rad = map.edge(place.edge)->alignment.at(place.offset_m).pose.heading_rad;
  return std::ranges::any_of(tracks_->beside(place), [&](const track::NearTrack& track) {
    const double turned_rad = map.edge(track.edge)->alignment.at(track.offset_m).pose.heading_rad - heading_rad;
    if (std::abs(std::cos(turned_rad)) < kAlongsideCosine) return false;
    const bool forward = (std::cos(turned_rad) > 0) == (place.direction != track::Direction::reverse);
    const double from_m = track.offset_m - (forward ? window.behind_m : window.ahead_m);
    const double to_m = track.offset_m + (forward ? window.ahead_m : window.behind_m);
    return std::ranges::any_of(map.landmarks_on(track.edge), [&](const track::Landmark* mark) {
      return track::seen_along(mark->kind, forward) == window.kind && lies_in_track(mark->kind, mark->lateral_m) &&
             mark->offset_m > from_m && mark->offset_m < to_m;
    });
  });
}

}  // namespace railfix::map_matcher
