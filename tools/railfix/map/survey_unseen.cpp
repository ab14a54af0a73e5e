// Landmarks of the map that runs passed and did not see.
#include <algorithm>
#include <map>
#include <set>

#include "map/survey.hpp"

namespace railfix::tool {
namespace {

constexpr double kMarginM = 5;  // a place near the end of what a run passed may lie beyond it

size_t runs_past(const track::Landmark& mark, const std::vector<PassedTrack>& on_edge) {
  std::set<size_t> runs;
  for (const PassedTrack& track : on_edge) {
    const double margin_m = kMarginM + mark.sigma_m;
    if (mark.offset_m - margin_m > track.from_m && mark.offset_m + margin_m < track.to_m) runs.insert(track.run);
  }
  return runs.size();
}

}  // namespace

std::vector<UnseenLandmark> unseen_landmarks(const track::Map& map, const Survey& survey,
                                             const std::vector<SurveySighting>& sightings,
                                             const std::vector<PassedTrack>& passed, size_t least_runs) {
  std::set<track::LandmarkKind> kinds;  // that the runs' cameras tell
  for (const SurveySighting& seen : sightings) kinds.insert(seen.kind);
  std::set<uint32_t> seen_ids;
  for (const SurveyedLandmark& found : survey.landmarks) seen_ids.insert(found.known_id);
  std::map<uint32_t, std::vector<PassedTrack>> passed_on;
  for (const PassedTrack& track : passed) passed_on[track.edge].push_back(track);
  std::vector<UnseenLandmark> out;
  for (const track::Landmark& mark : map.landmarks) {
    if (!kinds.contains(mark.kind) || seen_ids.contains(mark.id)) continue;
    const auto on_edge = passed_on.find(mark.edge);
    const size_t runs = on_edge == passed_on.end() ? 0 : runs_past(mark, on_edge->second);
    if (runs >= least_runs && runs > 0) out.push_back({&mark, runs});
  }
  return out;
}

}  // namespace railfix::tool
