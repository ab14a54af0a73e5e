#include "map_matcher/alike_places.hpp"

#include <algorithm>
#include <vector>

namespace railfix::map_matcher {
namespace {

constexpr double kReachM = 1000;  // so far off somebody tells a start by mistake
constexpr double kNearlyAsLikely = 0.01;
constexpr double kSamePlaceM = 0.5;

/// Where any of the sightings is of a landmark. Elsewhere all of them would be of nothing.
std::vector<double> shifts_that_fit_one(const SightingHistory& history, const track::Path& path, double least_m,
                                        double most_m) {
  std::vector<double> shifts;
  for (const auto& seen : history.seen()) {
    for (const auto* mark :
         landmarks_of_kind(path, seen.sighting.kind, seen.place_m + least_m, seen.place_m + most_m)) {
      if (fits_aside(seen.sighting, *mark)) shifts.push_back(mark->distance_m - seen.place_m);
    }
  }
  std::ranges::sort(shifts);
  const auto same = [](double a, double b) { return b - a < kSamePlaceM; };
  shifts.erase(std::unique(shifts.begin(), shifts.end(), same), shifts.end());
  return shifts;
}

}  // namespace

// A train that looks the other way and has run some way from where it was told to be is twice that way from here.
bool AlikePlaces::any(const TakenPlace& place) const {
  const double likely = kNearlyAsLikely * history_.likelihood(path_, place.shift_m, place.now_m);
  const Range along{place.shift_m - kReachM, place.shift_m + kReachM};
  if (any_likely(history_, place.now_m, along, {place.least_m, place.most_m}, likely)) return true;
  const double turned_m = place.shift_m + 2 * (place.now_m - place.since_told_m);
  return any_likely(history_.turned_round(), -place.now_m, {turned_m - kReachM, turned_m + kReachM}, {}, likely);
}

bool AlikePlaces::any_likely(const SightingHistory& history, double now_m, const Range& shifts, const Range& but,
                             double likely) const {
  return std::ranges::any_of(shifts_that_fit_one(history, path_, shifts.least_m, shifts.most_m), [&](double shift_m) {
    return !but.has(shift_m) && history.likelihood(path_, shift_m, now_m) > likely;
  });
}

}  // namespace railfix::map_matcher
