#include "map_matcher/beside_doubt.hpp"

#include <algorithm>
#include <cmath>

namespace railfix::map_matcher {
namespace {

constexpr double kMostOfOne = 20;  // maps err about single ones: three speak louder than any one
constexpr double kLeastOdds = 5e-5;
constexpr double kMostOdds = 99;          // less than would declare another leg for who begins with the rest
constexpr double kAlongsideCosine = 0.9;  // lines that cross are not beside

}  // namespace

void BesideDoubt::begin_anew() {
  odds_ = kTold;
  weighed_m_.reset();
}

// Where both tracks have one it says nothing, nor where neither has.
void BesideDoubt::sight(const track::Path& followed, const Sighting& sighting, const Prior& prior) {
  const double run_m = prior.travelled_m + sighting.distance_ahead_m;
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
  return std::ranges::any_of(tracks_->beside(place), [&](const track::TrackBeside& track) {
    const double along = std::cos(track.turned_rad);
    if (std::abs(along) < kAlongsideCosine) return false;
    const bool forward = (along > 0) == (place.direction != track::Direction::reverse);
    const double from_m = track.offset_m - (forward ? window.behind_m : window.ahead_m);
    const double to_m = track.offset_m + (forward ? window.ahead_m : window.behind_m);
    return std::ranges::any_of(map.landmarks_on(track.edge), [&](const track::Landmark* mark) {
      return track::seen_along(mark->kind, forward) == window.kind && lies_in_track(mark->kind, mark->lateral_m) &&
             mark->offset_m > from_m && mark->offset_m < to_m;
    });
  });
}

}  // namespace railfix::map_matcher
