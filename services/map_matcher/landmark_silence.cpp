#include "map_matcher/landmark_silence.hpp"

#include <algorithm>
#include <cstdio>

namespace railfix::map_matcher {
namespace {

constexpr int kFewest = 6;            // unsighted in a row: with one in five missed once in 15,000
constexpr double kShortestM = 2000;   // ... and no matter of one station, or of one stretch of masts in the dark
constexpr double kSightedNearM = 10;  // of the window

bool before(const track::PathLandmark& landmark, double distance_m) {
  return landmark.distance_m < distance_m;
}

}  // namespace

void LandmarkSilence::run_on(const track::Path& path, double path_distance_m, bool rails_in_sight) {
  const double from_m = here_m_.value_or(path_distance_m);
  here_m_ = path_distance_m;
  if (!rails_in_sight || path_distance_m <= from_m) return;
  way_m_ += path_distance_m - from_m;
  const auto& all = path.landmarks();
  const auto first = std::lower_bound(all.begin(), all.end(), from_m, before);
  const auto last = std::lower_bound(first, all.end(), path_distance_m, before);
  passed_ += static_cast<int>(
      std::count_if(first, last, [](const auto& landmark) { return track::can_be_sighted(landmark.kind); }));
}

void LandmarkSilence::sight(const track::Path& path, const Sighting& sighting, const Prior& prior) {
  if (!prior.usable()) return;
  const double place_m = prior.path_distance_m + sighting.distance_ahead_m;
  const double to_m = place_m + prior.under_m + kSightedNearM;
  const auto& all = path.landmarks();
  for (auto it = std::lower_bound(all.begin(), all.end(), place_m - prior.over_m - kSightedNearM, before);
       it != all.end() && it->distance_m <= to_m; ++it) {
    if (it->kind != sighting.kind) continue;
    passed_ = 0;
    way_m_ = 0;
    return;
  }
}

std::string LandmarkSilence::trouble() const {
  if (passed_ < kFewest || way_m_ < kShortestM) return {};
  char text[160];
  std::snprintf(text, sizeof text,
                "of the %d landmarks that the map has on the last %.1f km none was sighted: see what the camera shows "
                "and which kinds track_detector looks for",
                passed_, way_m_ / 1000);
  return text;
}

}  // namespace railfix::map_matcher
