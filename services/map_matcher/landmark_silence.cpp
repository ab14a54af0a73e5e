#include "map_matcher/landmark_silence.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>

namespace railfix::map_matcher {
namespace {

constexpr int kFewest = 6;            // unsighted in a row: with one in five missed once in 15,000
constexpr double kShortestM = 2000;   // from the first to the last: more than one station, or masts in one dark stretch
constexpr double kSightedNearM = 10;  // of the window
constexpr double kWayBackM = 50;      // is one; less may be the place that was corrected

}  // namespace

void LandmarkSilence::begin_way() {
  reached_m_.reset();
  sighted_m_.reset();
  last_of_kind_m_.clear();
}

void LandmarkSilence::run_on(const track::Path& path, double path_distance_m, bool rails_in_sight) {
  if (reached_m_ && path_distance_m < *reached_m_ - kWayBackM) begin_way();
  if (!reached_m_) reached_m_ = path_distance_m;
  const double from_m = *reached_m_;
  if (path_distance_m <= from_m) return;
  reached_m_ = path_distance_m;
  if (!rails_in_sight) return;
  for (const auto& landmark : path.landmarks_between(from_m, path_distance_m)) {
    if (track::can_be_sighted(landmark.kind)) pass(landmark, way_m_ + landmark.distance_m - from_m);
  }
  way_m_ += path_distance_m - from_m;
}

void LandmarkSilence::pass(const track::PathLandmark& landmark, double way_m) {
  const auto [last, first] = last_of_kind_m_.try_emplace(landmark.kind, landmark.distance_m);
  const bool same = !first && landmark.distance_m - last->second < kOneThingM;
  last->second = landmark.distance_m;
  if (same || (sighted_m_ && landmark.distance_m <= *sighted_m_)) return;
  last_m_ = way_m;
  if (unsighted_++ == 0) first_m_ = way_m;
}

void LandmarkSilence::sight(const track::Path& path, const Sighting& sighting, const Prior& prior) {
  if (!prior.usable()) return;
  const double place_m = prior.path_distance_m + sighting.distance_ahead_m;
  const track::PathLandmark* nearest = nullptr;
  for (const auto& landmark :
       path.landmarks_between(place_m - prior.over_m - kSightedNearM, place_m + prior.under_m + kSightedNearM)) {
    if (landmark.kind != sighting.kind) continue;
    if (nearest == nullptr || std::abs(landmark.distance_m - place_m) < std::abs(nearest->distance_m - place_m))
      nearest = &landmark;
  }
  if (nearest == nullptr) return;
  sighted_m_ = std::max(sighted_m_.value_or(nearest->distance_m), nearest->distance_m);
  unsighted_ = 0;
  way_m_ = 0;
}

std::string LandmarkSilence::trouble() const {
  if (unsighted_ < kFewest || last_m_ - first_m_ < kShortestM) return {};
  char text[160];
  std::snprintf(text, sizeof text,
                "of %d landmarks that the map has on the last %.1f km none was sighted: see what the camera shows and "
                "which kinds track_detector looks for",
                unsighted_, (way_m_ - first_m_) / 1000);
  return text;
}

}  // namespace railfix::map_matcher
