#include "map_matcher/beside_doubt.hpp"

#include <algorithm>
#include <cmath>

namespace railfix::map_matcher {
namespace {

using track::LandmarkKind;

constexpr double kOneThingM = 30;    // what is so near together, balises of a group, the map has wrong together
constexpr double kOwnRailsM = 1.0;   // further to the side it is no train's own
constexpr double kMostOfOne = 20;    // maps err about single ones: three speak louder than any one
constexpr double kLeastOdds = 5e-5;  // points that the map lacks may lead there later
constexpr double kMostOdds = 1e3;    // three of the track's own bring it back

bool lies_in_track(LandmarkKind kind, double lateral_m) {
  return (kind == LandmarkKind::balise || kind == LandmarkKind::frog) && std::abs(lateral_m) < kOwnRailsM;
}

}  // namespace

void BesideDoubt::begin_anew() {
  odds_ = kTold;
  weighed_m_.reset();
}

void BesideDoubt::sight(const track::Path& followed, const Sighting& sighting, const Prior& prior) {
  const double run_m = prior.travelled_m + sighting.distance_ahead_m;
  if (!lies_in_track(sighting.kind, sighting.lateral_m)) return;
  if (weighed_m_ && std::abs(run_m - *weighed_m_) < kOneThingM) return;
  weighed_m_ = run_m;
  const double place_m = prior.path_distance_m + sighting.distance_ahead_m;
  const double margin_m = parameters_.window_margin_m + parameters_.moved_m + 3 * sighting.sigma_m;
  const double behind_m = prior.over_m + margin_m;
  const double ahead_m = prior.under_m + margin_m;
  // So many a metre if the track has `count` of them in the window: they are anywhere in it, and some are of nothing.
  const auto density = [&](std::ptrdiff_t count) {
    return parameters_.false_per_m +
           parameters_.detection * sighting.confidence * static_cast<double>(count) / (behind_m + ahead_m);
  };
  const auto here = std::ranges::count_if(followed.landmarks_between(place_m - behind_m, place_m + ahead_m),
                                          [&](const track::PathLandmark& mark) { return mark.kind == sighting.kind; });
  const auto place = followed.position_at(place_m);
  const auto& map = followed.map();
  const double heading_rad = map.edge(place.edge)->alignment.at(place.offset_m).pose.heading_rad;
  std::ptrdiff_t beside = 0;
  for (const auto& track : tracks_->beside(place)) {
    const double turned_rad = map.edge(track.edge)->alignment.at(track.offset_m).pose.heading_rad - heading_rad;
    const bool forward = (std::cos(turned_rad) > 0) == (place.direction != track::Direction::reverse);
    const double from_m = track.offset_m - (forward ? behind_m : ahead_m);
    const double to_m = track.offset_m + (forward ? ahead_m : behind_m);
    beside = std::max(beside, std::ranges::count_if(map.landmarks_on(track.edge), [&](const track::Landmark* mark) {
                        return track::seen_along(mark->kind, forward) == sighting.kind && mark->offset_m > from_m &&
                               mark->offset_m < to_m;
                      }));
  }
  const double ratio = std::clamp(density(beside) / density(here), 1 / kMostOfOne, kMostOfOne);
  odds_ = std::clamp(odds_ * ratio, kLeastOdds, kMostOdds);
}

}  // namespace railfix::map_matcher
