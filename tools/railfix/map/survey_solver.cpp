#include "map/survey_solver.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <set>

namespace railfix::tool {

namespace {

constexpr int kRounds = 15;
constexpr double kLeastSigmaM = 0.01;
constexpr double kLost = 2;  // times the variance of a place that its way has drifted by

double weight_of(double sigma_m) {
  return 1.0 / std::pow(std::max(sigma_m, kLeastSigmaM), 2);
}

double median_offset(const std::vector<SurveySighting>& all, const Thing& thing) {
  std::vector<double> offsets;
  for (const size_t i : thing.sightings) offsets.push_back(all[i].offset_m);
  const auto middle = offsets.begin() + static_cast<ptrdiff_t>(offsets.size() / 2);
  std::nth_element(offsets.begin(), middle, offsets.end());
  return *middle;
}

}  // namespace

SurveySolver::SurveySolver(const std::vector<SurveySighting>& all, const std::vector<Thing>& things,
                           const SurveyOptions& options)
    : all_(all), things_(things), options_(options) {
  for (const auto& seen : all) {
    for (const int64_t side : {0, 1}) knots_.try_emplace(knot_of(seen, side), 0);
  }
  auto index = static_cast<Eigen::Index>(2 * things_.size());
  for (auto& [key, at] : knots_) at = index++;
  state_ = Eigen::VectorXd::Zero(index);
  for (size_t t = 0; t < things.size(); ++t) {
    const bool is_told = things[t].known != nullptr && !things[t].is_apart;
    state_[place_index(t)] = is_told ? things[t].known->offset_m : median_offset(all, things[t]);
  }
  for (const auto& seen : all) {  // a start for the error of the way: the run's place is right
    for (const int64_t side : {0, 1}) state_[knots_.at(knot_of(seen, side))] = seen.place_ahead_m;
  }
  told_ = told_places();
  for (int round = 0; round < kRounds; ++round) solve();
}

SurveySolver::Knot SurveySolver::knot_of(const SurveySighting& seen, int64_t side) const {
  return {seen.run, seen.stretch, static_cast<int64_t>(std::floor(seen.way_m / options_.knot_m)) + side};
}

double SurveySolver::sigma(size_t thing) const {
  Eigen::VectorXd unit = Eigen::VectorXd::Zero(state_.size());
  unit[place_index(thing)] = 1;
  return std::sqrt(factors_.solve(unit)[place_index(thing)]);
}

// A thing's place is the mean of what the map and what the runs say, by their weights; taken apart again.
std::optional<PlaceEstimate> SurveySolver::seen_place(size_t thing) const {
  constexpr double kNothing = 1e-6;  // of the map's weight
  const PlaceEstimate both{place(thing), sigma(thing)};
  if (things_[thing].is_apart) return both;
  const double all = std::pow(both.sigma_m, -2);
  const double map = weight_of(things_[thing].known->sigma_m);
  const double runs = all - map;
  if (runs <= kNothing * map) return std::nullopt;
  return PlaceEstimate{(all * both.place_m - map * things_[thing].known->offset_m) / runs, 1 / std::sqrt(runs)};
}

double SurveySolver::own_sigma(size_t sighting) const {
  return std::max(all_[sighting].sigma_m * std::sqrt(1 - options_.common_share), kLeastSigmaM);
}

SurveySolver::Terms SurveySolver::way_terms(size_t sighting, double sign) const {
  const SurveySighting& seen = all_[sighting];
  const double share = seen.way_m / options_.knot_m - std::floor(seen.way_m / options_.knot_m);
  return {{knots_.at(knot_of(seen, 0)), sign * (1 - share)}, {knots_.at(knot_of(seen, 1)), sign * share}};
}

SurveySolver::Terms SurveySolver::terms_of(size_t thing, size_t sighting) const {
  Terms terms = way_terms(sighting, all_[sighting].is_reverse ? 1.0 : -1.0);
  terms.insert(terms.begin(), {{place_index(thing), 1.0}, {common_index(thing), 1.0}});
  return terms;
}

double SurveySolver::seen_at(size_t sighting) const {
  double at_m = all_[sighting].unmoved_m();
  for (const auto& [index, factor] : way_terms(sighting, all_[sighting].is_reverse ? -1.0 : 1.0))
    at_m += factor * state_[index];
  return at_m;
}

double SurveySolver::error(size_t thing, size_t sighting) const {
  double off_m = all_[sighting].unmoved_m();
  for (const auto& [index, factor] : terms_of(thing, sighting)) off_m -= factor * state_[index];
  return off_m / own_sigma(sighting);
}

void SurveySolver::add(const Terms& terms, double value, double weight) {
  for (const auto& [i, a] : terms) {
    right_[i] += weight * a * value;
    for (const auto& [j, b] : terms) normal_.emplace_back(i, j, weight * a * b);
  }
}

void SurveySolver::add_sightings() {
  for (size_t t = 0; t < things_.size(); ++t) {
    if (const track::Landmark* known = things_[t].known; known != nullptr && !things_[t].is_apart)
      add({{place_index(t), 1.0}}, known->offset_m, weight_of(known->sigma_m));
    double variance = 0;
    for (const size_t i : things_[t].sightings) {
      variance += std::pow(all_[i].sigma_m, 2) / static_cast<double>(things_[t].sightings.size());
      const double off = std::abs(error(t, i));
      add(terms_of(t, i), all_[i].unmoved_m(), (off > kHuber ? kHuber / off : 1.0) * weight_of(own_sigma(i)));
    }
    add({{common_index(t), 1.0}}, 0, weight_of(std::sqrt(options_.common_share * variance)));
  }
}

void SurveySolver::add_knots() {
  for (auto knot = knots_.begin(), next = std::next(knot); next != knots_.end(); knot = next++) {
    const auto& [run, stretch, number] = knot->first;
    const auto& [next_run, next_stretch, next_number] = next->first;
    if (run != next_run || stretch != next_stretch) continue;
    const double apart_m = options_.knot_m * static_cast<double>(next_number - number);
    add({{next->second, 1.0}, {knot->second, -1.0}}, 0, weight_of(options_.drift * apart_m));
  }
}

// A run's place tells something new where its way alone would have lost what it told before.
double SurveySolver::told_anew_after_m(double run_sigma_m) const {
  const double drift_m = options_.drift * options_.knot_m;  // from knot to knot
  return std::max(options_.stretch_m, kLost * options_.knot_m * std::pow(run_sigma_m / drift_m, 2));
}

std::vector<SurveySolver::ToldPlace> SurveySolver::told_places() const {
  std::vector<size_t> order(all_.size());
  std::iota(order.begin(), order.end(), 0);
  std::ranges::sort(order, {}, [&](size_t i) { return std::tuple(all_[i].run, all_[i].stretch, all_[i].way_m); });
  std::vector<ToldPlace> told;
  for (const size_t i : order) {
    const auto& seen = all_[i];
    const auto* before = told.empty() ? nullptr : &all_[told.back().sighting];
    const bool anew = before == nullptr || before->run != seen.run || before->stretch != seen.stretch ||
                      seen.way_m >= told.back().begin_m + told.back().length_m;
    if (anew) told.push_back({i, seen.way_m, 0});
    auto& last = told.back();
    if (seen.run_sigma_m > all_[last.sighting].run_sigma_m) last.sighting = i;  // the least of what fixes told there
    last.length_m = told_anew_after_m(all_[last.sighting].run_sigma_m);
  }
  for (auto& one : told) one.runs = static_cast<double>(runs_along(one));
  return told;
}

size_t SurveySolver::runs_along(const ToldPlace& told) const {
  const auto& here = all_[told.sighting];
  std::set<size_t> runs;
  for (const auto& seen : all_) {
    if (seen.edge == here.edge && std::abs(seen.offset_m - here.offset_m) < told.length_m) runs.insert(seen.run);
  }
  return runs.size();
}

// The landmarks and curves of one map have told all runs their places, wrongly in the same way: those of all runs
// count once.
void SurveySolver::add_places_of_runs() {
  for (const auto& told : told_) {
    const auto& seen = all_[told.sighting];
    add(way_terms(told.sighting, 1.0), seen.place_ahead_m, weight_of(seen.run_sigma_m) / told.runs);
  }
}

void SurveySolver::solve() {
  normal_.clear();
  right_ = Eigen::VectorXd::Zero(state_.size());
  add_sightings();
  add_knots();
  add_places_of_runs();
  Eigen::SparseMatrix<double> normal(state_.size(), state_.size());
  normal.setFromTriplets(normal_.begin(), normal_.end());
  factors_.compute(normal);
  state_ = factors_.solve(right_);
}

}  // namespace railfix::tool
