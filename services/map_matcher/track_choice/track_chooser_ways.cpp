// Which ways the train may be on: opened ahead, kept behind, brought together, given up.
#include "map_matcher/track_choice/track_chooser.hpp"

#include <algorithm>
#include <cmath>
#include <functional>
#include <iterator>
#include <numeric>

#include "map_matcher/track_choice/picture_fits.hpp"
#include "track/declared.hpp"

namespace railfix::map_matcher {
namespace {

constexpr double kLeastProbability = 1e-7;
constexpr double kMapSigmas = 3;         // points are no further from where the map has them
constexpr double kWheelsBehindM = 5;     // the foot: points may be thrown in front of the first wheels
constexpr double kSameM = 1.0;           // two routes whose distances differ by less are one
constexpr size_t kMostHypotheses = 200;  // the stations of our maps have 47 at most
constexpr double kUnwatchedM = 3000;     // behind a switch that nobody watched, at most

}  // namespace

// Who begins does not know more than fusion. Where that has not declared the track the train may be on any leg of the
// switches that it came over, as far beyond them; else of those that it may stand in front of. Nobody knows which way
// a train came that stands: as the cab looks, if there is a switch that near.
void TrackChooser::open_ways_behind() {
  auto legs = other_legs(forwards_);
  const bool declared = window_.probability >= track::kDeclaredProbability;
  if (window_.stands && !declared && !legs.of_one_near) {
    auto other_way = other_legs(!forwards_);
    legs.probability = std::min(legs.probability, other_way.probability);
    std::ranges::move(other_way.routes, std::back_inserter(legs.routes));
  }
  told_ = legs.routes.empty() && !declared ? window_.probability : 1;
  if (legs.routes.empty()) return;
  hypotheses_.front().log_prior = std::log(legs.probability);
  const double share = (1 - legs.probability) / static_cast<double>(legs.routes.size());
  for (auto& route : legs.routes)
    hypotheses_.push_back({std::move(route), std::log(share), {0, std::log(parameters_.astray)}, {}});
}

TrackChooser::OtherLegs TrackChooser::other_legs(bool forwards) const {
  const bool declared = window_.probability >= track::kDeclaredProbability;
  const double behind_m = forwards ? window_.over_m : window_.under_m;
  const double in_front_m = behind_m + kMapSigmas * parameters_.map_sigma_m + kWheelsBehindM;
  track::Route back = hypotheses_.front().route;
  OtherLegs legs{{}, window_.probability};
  while (back.legs().size() < kMostHypotheses) {
    const double node_m = forwards ? -back.begin_m() : back.end_m();
    if (node_m > (declared ? in_front_m : kUnwatchedM) || legs.routes.size() > kMostHypotheses) break;
    const track::Run here = forwards ? back.legs().front().run : back.legs().back().run;
    const auto before = forwards ? ways_->before(here) : ways_->after(here);
    if (before.empty()) break;
    const track::Run& from = before.front();
    const auto ways = forwards ? ways_->after(from) : ways_->before(from);
    for (const auto& way : ways) {
      if (way == here) continue;
      const double switch_m = from.forward == forwards ? from.length_m() : 0.0;  // on the edge before it
      auto& other = legs.routes.emplace_back(from, switch_m, forwards ? back.begin_m() : back.end_m());
      forwards ? other.push_ahead(way) : other.push_behind(way);
    }
    if (node_m <= in_front_m && ways.size() > 1) {
      legs.probability = std::min(legs.probability, 1.0 / static_cast<double>(ways.size()));
      legs.of_one_near = true;
    }
    forwards ? back.push_behind(from) : back.push_ahead(from);
  }
  return legs;
}

// What lies ahead may be set otherwise once the train has left it: only what its wheels certainly stand on is kept.
void TrackChooser::turn_round() {
  const double map_m = kMapSigmas * parameters_.map_sigma_m;
  double wheels_m = place_m_ - window_.over_m - map_m - kWheelsBehindM;
  double foot_m = place_m_ + window_.under_m + map_m;
  // Nor what was only guessed, however far the train has come back before anyone saw it.
  if (forwards_) {
    foot_m = std::max(foot_m, std::nextafter(guessed_m_, INFINITY));
  } else {
    wheels_m = std::min(wheels_m, std::nextafter(guessed_m_, -INFINITY));
  }
  forwards_ = !forwards_;
  guess_nothing();
  moved_back_m_ = 0;
  cells_m_ += pending_.way_m;
  pending_ = {};
  for (auto& hypothesis : hypotheses_) {
    auto& route = hypothesis.route;
    if (forwards_) {
      while (route.legs().size() > 1 && route.legs().back().begin_m > wheels_m) route.drop_ahead();
    } else {
      while (route.legs().size() > 1 && route.legs().front().end_m() < foot_m) route.drop_behind();
    }
  }
  merge();
  extend();
  fit_cells();
}

// In the direction of travel every way is a hypothesis of its own.
void TrackChooser::extend() {
  for (size_t i = 0; i < hypotheses_.size();) {
    auto& route = hypotheses_[i].route;
    const bool enough =
        forwards_ ? route.end_m() > last_m() + parameters_.reach_m : route.begin_m() < first_m() - parameters_.reach_m;
    const auto ways = enough      ? std::vector<track::Run>()
                      : forwards_ ? ways_->after(route.legs().back().run)
                                  : ways_->before(route.legs().front().run);
    if (ways.empty()) {
      ++i;
      continue;
    }
    hypotheses_[i].log_prior -= std::log(static_cast<double>(ways.size()));
    const Hypothesis stem = hypotheses_[i];
    for (size_t k = 0; k < ways.size(); ++k) {
      if (k > 0) hypotheses_.push_back(stem);
      auto& longer = k == 0 ? hypotheses_[i].route : hypotheses_.back().route;
      forwards_ ? longer.push_ahead(ways[k]) : longer.push_behind(ways[k]);
    }
    if (hypotheses_.size() > kMostHypotheses) prune();
  }
  for (auto& hypothesis : hypotheses_) extend_behind(hypothesis.route);
}

// Where the train came from matters only for the cells that lie there: the straight way will do, until it backs there.
void TrackChooser::extend_behind(track::Route& route) {
  while (forwards_ && route.begin_m() > first_m()) {
    const auto ways = ways_->before(route.legs().front().run);
    if (ways.empty()) return;
    if (ways.size() > 1) guessed_m_ = std::max(guessed_m_, route.begin_m());
    route.push_behind(ways.front());
  }
  while (!forwards_ && route.end_m() < last_m()) {
    const auto& ways = ways_->after(route.legs().back().run);
    if (ways.empty()) return;
    if (ways.size() > 1) guessed_m_ = std::min(guessed_m_, route.end_m());
    route.push_ahead(ways.front());
  }
}

void TrackChooser::guess_nothing() {
  guessed_m_ = forwards_ ? -INFINITY : INFINITY;
}

void TrackChooser::trim() {
  for (auto& hypothesis : hypotheses_) {
    auto& route = hypothesis.route;
    if (forwards_) {
      while (route.legs().size() > 1 && route.legs().front().end_m() < first_m() - kCellM) route.drop_behind();
    } else {
      while (route.legs().size() > 1 && route.legs().back().begin_m > last_m() + kCellM) route.drop_ahead();
    }
  }
}

// Both may be true: cell by cell, since the one with less evidence may know better where the train stands.
void TrackChooser::join(Hypothesis& into, const Hypothesis& other) {
  const auto log_before_turning = [](const Hypothesis& h) {
    return h.log_prior + log_sum(h.pictures.own, h.pictures.astray);
  };
  const double log_into = log_before_turning(into);
  const double log_other = log_before_turning(other);
  for (size_t i = 0; i < into.cells.size(); ++i) join_cells(into.cells[i], log_into, other.cells[i], log_other);
  const double log_prior = log_sum(into.log_prior, other.log_prior);
  const auto joined = [&](double Pictures::*state) {
    return log_sum(into.log_prior + into.pictures.*state, other.log_prior + other.pictures.*state) - log_prior;
  };
  into.pictures = {joined(&Pictures::own), joined(&Pictures::astray)};
  into.log_prior = log_prior;
}

void TrackChooser::merge() {
  const auto same = [](const track::Route& a, const track::Route& b) {
    return std::equal(
        a.legs().begin(), a.legs().end(), b.legs().begin(), b.legs().end(),
        [](const auto& x, const auto& y) { return x.run == y.run && std::abs(x.begin_m - y.begin_m) < kSameM; });
  };
  for (size_t i = 0; i < hypotheses_.size(); ++i) {
    for (size_t k = i + 1; k < hypotheses_.size();) {
      if (!same(hypotheses_[i].route, hypotheses_[k].route)) {
        ++k;
        continue;
      }
      join(hypotheses_[i], hypotheses_[k]);
      hypotheses_.erase(hypotheses_.begin() + static_cast<std::ptrdiff_t>(k));
    }
  }
}

// What nobody has shown to be wrong and is given up for lack of room is not known any more; in the dark many are alike.
void TrackChooser::prune() {
  std::vector<double> logs;
  for (const auto& hypothesis : hypotheses_) logs.push_back(evidence(hypothesis));
  std::vector<size_t> by_evidence(logs.size());
  std::iota(by_evidence.begin(), by_evidence.end(), size_t{0});
  std::ranges::stable_sort(by_evidence, std::ranges::greater{}, [&](size_t i) { return logs[i]; });
  const double best = logs[by_evidence.front()];
  const double least = best + std::log(kLeastProbability);
  std::vector<bool> keeps(logs.size(), false);
  double kept_log = -INFINITY;
  double given_up_log = -INFINITY;
  for (size_t rank = 0; rank < by_evidence.size(); ++rank) {
    const double log = logs[by_evidence[rank]];
    if (rank > 0 && log <= least) break;
    keeps[by_evidence[rank]] = rank < kMostHypotheses;
    auto& sum_log = rank < kMostHypotheses ? kept_log : given_up_log;
    sum_log = log_sum(sum_log, log);
  }
  told_ *= std::exp(kept_log - log_sum(kept_log, given_up_log));
  std::vector<Hypothesis> kept;
  for (size_t i = 0; i < logs.size(); ++i) {
    if (!keeps[i]) continue;
    kept.push_back(std::move(hypotheses_[i]));
    kept.back().log_prior -= best;
  }
  hypotheses_ = std::move(kept);
}

}  // namespace railfix::map_matcher
