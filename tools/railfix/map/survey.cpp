#include "map/survey.hpp"

#include <algorithm>
#include <cmath>
#include <map>
#include <numeric>
#include <set>

#include "map/survey_apart.hpp"
#include "map/survey_known.hpp"
#include "map/survey_solver.hpp"

namespace railfix::tool {
namespace {

constexpr int kRounds = 3;
constexpr double kLocaccSigmas = 4;

/// What is further aside is another one: of those that came last more than one may be near.
std::vector<size_t>* near_thing(std::vector<Thing>& things, const std::vector<SurveySighting>& all,
                                const std::vector<double>& places, size_t sighting, double gate_m) {
  constexpr size_t kAbreast = 4;
  for (size_t back = 1; back <= std::min(kAbreast, things.size()); ++back) {
    auto& sightings = things[things.size() - back].sightings;
    const SurveySighting& last = all[sightings.back()];
    const bool near = places[sighting] - places[sightings.back()] < gate_m;
    if (near && alike(all[sighting], last.kind, last.edge, last.lateral_m)) return &sightings;
  }
  return nullptr;
}

/// Sightings sorted by kind, side and place fall into things. Where a run tells one thing apart from the last one,
/// those of other runs that lie nearer to the new one go with it.
std::vector<Thing> new_things(const std::vector<SurveySighting>& all, const std::vector<double>& places,
                              const std::vector<size_t>& sorted, double gate_m) {
  std::vector<Thing> things;
  for (const size_t i : sorted) {
    auto* last = near_thing(things, all, places, i, gate_m);
    const bool near = last != nullptr;
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
  out.reserve(known.size());
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

/// Sightings, outliers and spread; and by how much the sigma of each thing is to be widened: where the sightings of one
/// are at odds among themselves, that is its own matter.
std::vector<double> judge(const SurveySolver& solver, const std::vector<Thing>& things, Survey& survey) {
  constexpr double kOutlier = 2.0 * SurveySolver::kHuber;
  constexpr double kAtOdds = 2.0;
  std::vector<double> own(things.size(), 0);
  double squares = 0;
  double count = 0;
  for (size_t t = 0; t < things.size(); ++t) {
    double of_thing = 0;
    for (const size_t i : things[t].sightings) {
      const double error = std::abs(solver.error(t, i));
      if (error > kOutlier) ++survey.outliers;
      of_thing += std::pow(std::min(error, kOutlier), 2);
    }
    const size_t sightings = things[t].sightings.size();
    survey.sightings += sightings;
    own[t] = sightings > 1 ? std::sqrt(of_thing / static_cast<double>(sightings - 1)) : 0;
    if (own[t] > kAtOdds) continue;
    squares += of_thing;
    count += static_cast<double>(sightings);
  }
  survey.spread = count > 0 ? std::sqrt(squares / count) : 0;
  for (double& widening : own) widening = std::max({1.0, survey.spread, widening > kAtOdds ? widening : 0.0});
  return own;
}

/// The side that is not known (0) counts for nothing.
double mean_lateral_m(const Thing& thing, const std::vector<SurveySighting>& all) {
  double sum_m = 0;
  double count = 0;
  for (const size_t i : thing.sightings) {
    sum_m += all[i].lateral_m;
    count += all[i].lateral_m != 0 ? 1 : 0;
  }
  return count > 0 ? sum_m / count : 0;
}

bool one_side(const Thing& thing, const std::vector<SurveySighting>& all) {
  const auto on = [&](double sign) {
    return std::ranges::any_of(thing.sightings, [&](size_t i) { return sign * all[i].lateral_m > 0; });
  };
  return !on(1) || !on(-1);
}

/// Runs that see it nearer to the survey's place than to the map's.
size_t runs_apart(const Thing& thing, const std::vector<SurveySighting>& all, const SurveySolver& solver,
                  double place_m) {
  std::map<size_t, std::vector<double>> nearer_m;
  for (const size_t i : thing.sightings) {
    const double seen_m = solver.seen_at(i);
    nearer_m[all[i].run].push_back(std::abs(seen_m - thing.known->offset_m) - std::abs(seen_m - place_m));
  }
  return static_cast<size_t>(std::ranges::count_if(
      nearer_m, [](const auto& run) { return std::accumulate(run.second.begin(), run.second.end(), 0.0) > 0; }));
}

SurveyedLandmark new_landmark(const Thing& thing, const std::vector<SurveySighting>& all, PlaceEstimate place) {
  const SurveySighting& first = all[thing.sightings.front()];
  SurveyedLandmark found;
  found.landmark = {0, first.kind, first.edge, place.place_m, mean_lateral_m(thing, all), place.sigma_m, ""};
  return found;
}

/// Never vaguer than on the map, unless several runs see it elsewhere: then where they see it, with a sigma that still
/// holds the map's place.
SurveyedLandmark known_landmark(const track::Map& map, const Thing& thing, const std::vector<SurveySighting>& all,
                                const SurveySolver& solver, PlaceEstimate place, size_t least_runs) {
  SurveyedLandmark found;
  const track::Landmark& known = *thing.known;
  found.known_id = known.id;
  found.landmark = known;
  // Once its sigma is that of a survey nobody takes its distance aside for a guess any more.
  const double seen_m = mean_lateral_m(thing, all);
  if (has_side(known.kind) && !track::is_aside_measured(known) && seen_m != 0 && one_side(thing, all))
    found.landmark.lateral_m = seen_m;
  if (thing.is_apart) {
    found.runs_apart = runs_apart(thing, all, solver, place.place_m);
    found.apart_m = place.place_m - known.offset_m;
    if (found.runs_apart < least_runs) return found;
    found.landmark.sigma_m = std::max(place.sigma_m, std::abs(found.apart_m) / kApartSigmas);
  } else {
    if (known_ones_stay(map)) return found;
    found.landmark.sigma_m = std::min(place.sigma_m, known.sigma_m);
  }
  found.landmark.offset_m = place.place_m;
  found.moved_m = place.place_m - known.offset_m;
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
  places.reserve(sightings.size());
  for (const auto& sighting : sightings) places.push_back(sighting.offset_m);
  for (int round = 1;; ++round) {
    Survey out;
    std::vector<Thing> things = things_of(map, sightings, places, options.gate_m);
    out.left_alone = leave_alone(things, sightings, options.least_runs);
    if (things.empty()) return out;
    if (round < kRounds) {  // runs that lay apart come together: then what belongs together shows better
      const SurveySolver solver(sightings, things, options);
      for (size_t i = 0; i < sightings.size(); ++i) places[i] = solver.seen_at(i);
      continue;
    }
    const auto solver = solve_without_moved(sightings, things, options);
    const std::vector<double> widening = judge(*solver, things, out);
    for (size_t t = 0; t < things.size(); ++t) {
      const uint32_t edge = sightings[things[t].sightings.front()].edge;
      const double place_m = std::clamp(solver->place(t), 0.0, map.edge(edge)->alignment.length_m());
      const PlaceEstimate place{place_m, solver->sigma(t) * widening[t]};
      out.landmarks.push_back(things[t].known == nullptr
                                  ? new_landmark(things[t], sightings, place)
                                  : known_landmark(map, things[t], sightings, *solver, place, options.least_runs));
      out.landmarks.back().sightings = things[t].sightings.size();
      out.landmarks.back().runs = runs_of(things[t], sightings);
    }
    return out;
  }
}

void apply_survey(const Survey& survey, track::Map& map) {
  for (const SurveyedLandmark& found : survey.landmarks) {
    if (found.known_id != 0) {
      const bool moves = found.landmark.offset_m != map.landmarks[found.known_id - 1].offset_m ||
                         found.landmark.sigma_m != map.landmarks[found.known_id - 1].sigma_m;
      map.landmarks[found.known_id - 1] = found.landmark;
      if (moves && found.landmark.kind == track::LandmarkKind::balise) move_group(found, map);
      continue;
    }
    track::Landmark added = found.landmark;
    added.id = static_cast<uint32_t>(map.landmarks.size() + 1);
    added.name = "surveyed " + track::to_string(added.kind) + " " + std::to_string(added.id);
    map.landmarks.push_back(added);
  }
}

}  // namespace railfix::tool
