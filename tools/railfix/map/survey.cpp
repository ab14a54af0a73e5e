#include "map/survey.hpp"

#include <algorithm>
#include <cmath>
#include <map>
#include <set>

#include "map/survey_known.hpp"
#include "map/survey_solver.hpp"

namespace railfix::tool {
namespace {

constexpr int kRounds = 3;
constexpr double kLocaccSigmas = 4;

/// Sightings sorted by kind, side and place fall into things. Where a run tells one thing apart from the last one,
/// those of other runs that lie nearer to the new one go with it.
std::vector<Thing> new_things(const std::vector<SurveySighting>& all, const std::vector<double>& places,
                              const std::vector<size_t>& sorted, double gate_m) {
  std::vector<Thing> things;
  for (const size_t i : sorted) {
    auto* last = things.empty() ? nullptr : &things.back().sightings;
    const bool near = last != nullptr &&
                      alike(all[i], all[last->back()].kind, all[last->back()].edge, all[last->back()].lateral_m) &&
                      places[i] - places[last->back()] < gate_m;
    const bool apart = near && std::ranges::any_of(*last, [&](size_t other) { return told_apart(all[i], all[other]); });
    if (near && !apart) {
      last->push_back(i);
      continue;
    }
    Thing thing;
    while (apart && last->size() > 1 &&
           places[i] - places[last->back()] < places[last->back()] - places[last->front()] &&
           !told_apart(all[i], all[last->back()])) {
      thing.sightings.push_back(last->back());
      last->pop_back();
    }
    std::ranges::reverse(thing.sightings);
    thing.sightings.push_back(i);
    things.push_back(std::move(thing));
  }
  return things;
}

/// `places`: along its edge, of every sighting.
std::vector<Thing> things_of(const track::Map& map, const std::vector<SurveySighting>& all,
                             const std::vector<double>& places, double gate_m) {
  std::map<const track::Landmark*, Thing> known;
  std::vector<size_t> rest;
  const auto marks = known_marks(map, all, places, gate_m);
  for (size_t i = 0; i < all.size(); ++i) {
    if (marks[i] == nullptr) {
      rest.push_back(i);
    } else {
      known[marks[i]].known = marks[i];
      known[marks[i]].sightings.push_back(i);
    }
  }
  std::vector<Thing> out;
  for (auto& [mark, thing] : known) out.push_back(std::move(thing));
  std::sort(rest.begin(), rest.end(), [&](size_t a, size_t b) {
    const auto key = [&](size_t i) {
      return std::tuple(all[i].edge, all[i].kind, has_side(all[i].kind) && all[i].lateral_m >= 0, places[i]);
    };
    return key(a) < key(b);
  });
  for (auto& thing : new_things(all, places, rest, gate_m)) out.push_back(std::move(thing));
  return out;
}

size_t runs_of(const Thing& thing, const std::vector<SurveySighting>& all) {
  std::set<size_t> runs;
  for (const size_t i : thing.sightings) runs.insert(all[i].run);
  return runs.size();
}

size_t leave_alone(std::vector<Thing>& things, const std::vector<SurveySighting>& all, size_t least_runs) {
  size_t left_alone = 0;
  std::erase_if(things, [&](const Thing& thing) {
    const bool too_few = thing.known == nullptr && runs_of(thing, all) < least_runs;
    if (too_few) left_alone += thing.sightings.size();
    return too_few;
  });
  return left_alone;
}

/// Sightings, outliers and spread.
void judge(const SurveySolver& solver, const std::vector<Thing>& things, Survey& survey) {
  constexpr double kOutlier = 2.0 * SurveySolver::kHuber;
  double squares = 0;
  for (size_t t = 0; t < things.size(); ++t) {
    for (const size_t i : things[t].sightings) {
      const double error = std::abs(solver.error(t, i));
      ++survey.sightings;
      if (error > kOutlier) ++survey.outliers;
      squares += std::pow(std::min(error, kOutlier), 2);
    }
  }
  survey.spread = std::sqrt(squares / static_cast<double>(survey.sightings));
}

SurveyedLandmark landmark_of(const track::Map& map, const Thing& thing, const std::vector<SurveySighting>& all,
                             double place_m, double sigma_m) {
  SurveyedLandmark found;
  const SurveySighting& first = all[thing.sightings.front()];
  if (thing.known != nullptr) {
    found.known_id = thing.known->id;
    found.landmark = *thing.known;
  } else {
    double lateral_m = 0;
    for (const size_t i : thing.sightings) lateral_m += all[i].lateral_m / static_cast<double>(thing.sightings.size());
    found.landmark = {0, first.kind, first.edge, 0, lateral_m, 0, ""};
  }
  found.sightings = thing.sightings.size();
  found.runs = runs_of(thing, all);
  if (thing.known != nullptr && known_ones_stay(map)) return found;
  found.landmark.offset_m = std::clamp(place_m, 0.0, map.edge(first.edge)->alignment.length_m());
  found.landmark.sigma_m = sigma_m;
  found.moved_m = thing.known != nullptr ? found.landmark.offset_m - thing.known->offset_m : 0.0;
  return found;
}

/// A group lies where its reference balise does, as surely as that is known.
void move_group(const SurveyedLandmark& reference, track::Map& map) {
  for (track::BaliseGroup& group : map.balise_groups) {
    if (group.balises.empty() || group.balises.front() != reference.known_id) continue;
    group.offset_m = reference.landmark.offset_m;
    group.q_locacc_m = std::max(1.0, std::ceil(kLocaccSigmas * reference.landmark.sigma_m));
  }
}

}  // namespace

Survey survey_landmarks(const track::Map& map, const std::vector<SurveySighting>& sightings,
                        const SurveyOptions& options) {
  std::vector<double> places;
  for (const auto& sighting : sightings) places.push_back(sighting.offset_m);
  for (int round = 1;; ++round) {
    Survey out;
    std::vector<Thing> things = things_of(map, sightings, places, options.gate_m);
    out.left_alone = leave_alone(things, sightings, options.least_runs);
    if (things.empty()) return out;
    const SurveySolver solver(sightings, things, options);
    for (size_t i = 0; i < sightings.size(); ++i) places[i] = solver.seen_at(i);
    if (round < kRounds) continue;  // runs that lay apart are together now: what belongs together shows better
    judge(solver, things, out);
    for (size_t t = 0; t < things.size(); ++t)
      out.landmarks.push_back(
          landmark_of(map, things[t], sightings, solver.place(t), solver.sigma(t) * std::max(1.0, out.spread)));
    return out;
  }
}

void apply_survey(const Survey& survey, track::Map& map) {
  for (const SurveyedLandmark& found : survey.landmarks) {
    if (found.known_id != 0) {
      if (known_ones_stay(map)) continue;
      map.landmarks[found.known_id - 1] = found.landmark;
      if (found.landmark.kind == track::LandmarkKind::balise) move_group(found, map);
      continue;
    }
    track::Landmark added = found.landmark;
    added.id = static_cast<uint32_t>(map.landmarks.size() + 1);
    added.name = "surveyed " + track::to_string(added.kind) + " " + std::to_string(added.id);
    map.landmarks.push_back(added);
  }
}

}  // namespace railfix::tool
