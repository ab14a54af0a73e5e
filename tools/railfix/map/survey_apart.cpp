#include "map/survey_apart.hpp"

#include <algorithm>
#include <cmath>
#include <functional>
#include <map>

namespace railfix::tool {
namespace {

constexpr int kMostRounds = 30;

constexpr double kScaleSigma = 0.005;  // of a run's way, all along: the solver's drift is one to and fro

/// Along the ways of runs, what the map holds them by: things that it knows and that have not moved.
class Holds {
 public:
  Holds(const std::vector<SurveySighting>& all, const std::vector<Thing>& things) : all_(all) {
    for (size_t t = 0; t < things.size(); ++t) {
      if (things[t].known == nullptr || things[t].is_apart) continue;
      for (const size_t i : things[t].sightings) along_[way_of(i)].emplace_back(all[i].way_m, t);
    }
    for (auto& [way, holds] : along_) std::ranges::sort(holds);
  }
  /// How far from other holds a thing is at the end of a way. Between two of them a scale cancels out.
  [[nodiscard]] double beyond_m(size_t thing, size_t sighting) const {
    const auto holds = along_.find(way_of(sighting));
    if (holds == along_.end()) return 0;
    double before_m = HUGE_VAL;
    double behind_m = HUGE_VAL;
    for (const auto& [way_m, other] : holds->second) {
      const double from_m = way_m - all_[sighting].way_m;
      if (other != thing)
        (from_m < 0 ? before_m : behind_m) = std::min(from_m < 0 ? before_m : behind_m, std::abs(from_m));
    }
    const bool at_end = std::isfinite(before_m) != std::isfinite(behind_m);
    return at_end ? std::min(before_m, behind_m) : 0;
  }

 private:
  [[nodiscard]] std::pair<size_t, size_t> way_of(size_t sighting) const {
    return {all_[sighting].run, all_[sighting].stretch};
  }
  const std::vector<SurveySighting>& all_;
  std::map<std::pair<size_t, size_t>, std::vector<std::pair<double, size_t>>> along_;
};

/// In sigmas, of the map's place and the runs' place of a known thing.
double sigmas_apart(const SurveySolver& solver, const std::vector<Thing>& things, const Holds& holds, size_t t) {
  const track::Landmark* known = things[t].known;
  const auto seen = known != nullptr ? solver.seen_place(t) : std::nullopt;
  if (!seen) return 0;
  const double apart_m = std::abs(seen->place_m - known->offset_m);
  const double sigma_m = std::hypot(known->sigma_m, seen->sigma_m);
  if (apart_m <= kApartSigmas * sigma_m) return apart_m / sigma_m;
  double beyond_m = 0;
  for (const size_t i : things[t].sightings) beyond_m = std::max(beyond_m, holds.beyond_m(t, i));
  return apart_m / std::hypot(sigma_m, kScaleSigma * beyond_m);
}

/// The worst ones; those near them may only seem so.
bool mark_worst(const SurveySolver& solver, const std::vector<SurveySighting>& all, std::vector<Thing>& things,
                double near_m) {
  const Holds holds(all, things);
  std::vector<std::pair<double, size_t>> apart;
  for (size_t t = 0; t < things.size(); ++t) {
    const double sigmas = things[t].is_apart ? 0.0 : sigmas_apart(solver, things, holds, t);
    if (sigmas > kApartSigmas) apart.emplace_back(sigmas, t);
  }
  std::ranges::sort(apart, std::greater());
  std::vector<const track::Landmark*> marked;
  for (const auto& [sigmas, t] : apart) {
    const track::Landmark* known = things[t].known;
    const bool beside_worse = std::ranges::any_of(marked, [&](const track::Landmark* worse) {
      return worse->edge == known->edge && std::abs(worse->offset_m - known->offset_m) < near_m;
    });
    if (beside_worse) continue;
    things[t].is_apart = true;
    marked.push_back(known);
  }
  return !marked.empty();
}

/// Those that agree after all, now that worse ones are out.
bool readmit(const SurveySolver& solver, const std::vector<SurveySighting>& all, std::vector<Thing>& things) {
  const Holds holds(all, things);
  bool any = false;
  for (size_t t = 0; t < things.size(); ++t) {
    if (!things[t].is_apart || sigmas_apart(solver, things, holds, t) > kApartSigmas) continue;
    things[t].is_apart = false;
    any = true;
  }
  return any;
}

}  // namespace

std::unique_ptr<const SurveySolver> solve_without_moved(const std::vector<SurveySighting>& all,
                                                        std::vector<Thing>& things, const SurveyOptions& options) {
  auto solver = std::make_unique<const SurveySolver>(all, things, options);
  for (int round = 0; round < kMostRounds && mark_worst(*solver, all, things, options.stretch_m); ++round)
    solver = std::make_unique<const SurveySolver>(all, things, options);
  if (readmit(*solver, all, things)) solver = std::make_unique<const SurveySolver>(all, things, options);
  return solver;
}

}  // namespace railfix::tool
