#include "map/survey_apart.hpp"

#include <algorithm>
#include <cmath>

namespace railfix::tool {
namespace {

constexpr int kMostRounds = 30;

/// In sigmas, of the map's place and the runs' place of a known thing.
double sigmas_apart(const SurveySolver& solver, const std::vector<Thing>& things, size_t t) {
  const track::Landmark* known = things[t].known;
  const auto seen = known != nullptr ? solver.seen_place(t) : std::nullopt;
  if (!seen) return 0;
  return std::abs(seen->place_m - known->offset_m) / std::hypot(known->sigma_m, seen->sigma_m);
}

/// The worst ones; those near them may only seem so.
bool mark_worst(const SurveySolver& solver, std::vector<Thing>& things, double near_m) {
  std::vector<std::pair<double, size_t>> apart;
  for (size_t t = 0; t < things.size(); ++t) {
    const double sigmas = things[t].is_apart ? 0.0 : sigmas_apart(solver, things, t);
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
bool readmit(const SurveySolver& solver, std::vector<Thing>& things) {
  bool any = false;
  for (size_t t = 0; t < things.size(); ++t) {
    if (!things[t].is_apart || sigmas_apart(solver, things, t) > kApartSigmas) continue;
    things[t].is_apart = false;
    any = true;
  }
  return any;
}

}  // namespace

std::unique_ptr<const SurveySolver> solve_without_moved(const std::vector<SurveySighting>& all,
                                                        std::vector<Thing>& things, const SurveyOptions& options) {
  auto solver = std::make_unique<const SurveySolver>(all, things, options);
  for (int round = 0; round < kMostRounds && mark_worst(*solver, things, options.stretch_m); ++round)
    solver = std::make_unique<const SurveySolver>(all, things, options);
  if (readmit(*solver, things)) solver = std::make_unique<const SurveySolver>(all, things, options);
  return solver;
}

}  // namespace railfix::tool
