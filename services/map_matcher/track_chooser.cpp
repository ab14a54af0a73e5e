#include "map_matcher/track_chooser.hpp"

#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>

namespace railfix::map_matcher {
namespace {

constexpr double kCellM = 1.0;
constexpr double kDriftPerM = 0.07;    // a bin's way may be so wrong, for the spreading of the cells
constexpr double kMostSquared = 12.0;  // a bin that fits worse than this is not believed more
constexpr double kLostM = 60.0;        // afterwards the window is right and the routes are not
constexpr double kLeastProbability = 1e-7;
constexpr double kTurnRoundM = 0.3;
constexpr double kSameM = 5.0;  // two routes whose distances differ by less are one
constexpr double kFarFromWindowM = 200;
constexpr double kMostWindowM = 300;
constexpr size_t kMostHypotheses = 24;
constexpr double kSideM = 0.3;
constexpr double kNoiseShare = 1.5;       // no sensor knows its own noise better
constexpr double kNoLagShare = 0.3;       // of the cars
constexpr double kHalfBodyM = 8.0;        // a long car turns with the mean of the track below it
constexpr double kViewStepM = 3.0;        // places where the curvature in a picture is read from the map
constexpr double kBiasForgetPerM = 5e-4;  // the sensor's bias may be another one after some kilometres

double log_sum(double a, double b) {
  const double most = std::max(a, b);
  if (!std::isfinite(most)) return most;
  return most + std::log1p(std::exp(std::min(a, b) - most));
}

/// Sums of a route's curvature every metre, so that means over any stretch are cheap.
class CurvatureSums {
 public:
  CurvatureSums(const track::Route& route, double first_m, double last_m) : first_m_(first_m) {
    sums_.push_back(0);
    for (double m = first_m + 0.5; m < last_m + 1; m += 1) sums_.push_back(sums_.back() + route.curvature_at(m));
  }
  /// REQUIRES: from_m < to_m, both within the stretch.
  [[nodiscard]] double mean(double from_m, double to_m) const { return (sum(to_m) - sum(from_m)) / (to_m - from_m); }

 private:
  [[nodiscard]] double sum(double m) const {
    const double cell = std::clamp(m - first_m_, 0.0, static_cast<double>(sums_.size()) - 1.001);
    const auto i = static_cast<size_t>(cell);
    return sums_[i] + (cell - static_cast<double>(i)) * (sums_[i + 1] - sums_[i]);
  }
  double first_m_;
  std::vector<double> sums_;
};

}  // namespace

void TrackChooser::start(const TrackWindow& window) {
  hypotheses_.clear();
  pending_ = {};
  lost_m_ = moved_back_m_ = 0;
  place_m_ = 0;
  window_ = window;
  const track::Run run{map_->edge(window.place.edge), window.place.direction != track::Direction::reverse};
  hypotheses_.push_back({track::Route(run, window.place.offset_m, 0), 0, {0, std::log(parameters_.astray)}, {}});
  cells_m_ = first_m();
  extend_behind(hypotheses_.front().route);
  fit_cells();
  extend();
}

void TrackChooser::follow(const TrackWindow& window) {
  TrackWindow wanted = window;
  wanted.over_m = std::clamp(window.over_m, 0.0, kMostWindowM);
  wanted.under_m = std::clamp(window.under_m, 0.0, kMostWindowM);
  std::optional<double> found;
  double best = -INFINITY;
  for (const auto& hypothesis : hypotheses_) {
    const auto place_m = hypothesis.route.distance_of(window.place, place_m_);
    if (!place_m || std::abs(*place_m - place_m_) > kFarFromWindowM || hypothesis.log_prior <= best) continue;
    found = place_m;
    best = hypothesis.log_prior;
  }
  if (hypotheses_.empty() || (!found && lost_m_ > kLostM)) {
    start(wanted);
    return;
  }
  // A window on a track that was given up is followed on the one that is left.
  if (found) {
    place_m_ = *found;
    lost_m_ = 0;
  }
  window_ = wanted;
}

void TrackChooser::move(const Turn& turn) {
  if (hypotheses_.empty()) return;
  if (turn.sensor != sensor_) {
    sensor_ = turn.sensor;
    for (auto& hypothesis : hypotheses_) {
      for (auto& cell : hypothesis.cells) cell = {cell.log_weight, 0, 1};
    }
  }
  place_m_ += turn.way_m;
  lost_m_ += std::abs(turn.way_m);
  moved_back_m_ = std::max(0.0, moved_back_m_ - (forwards_ ? turn.way_m : -turn.way_m));
  if (moved_back_m_ > kTurnRoundM) turn_round();
  run_pictures(turn.way_m);
  pending_.way_m += turn.way_m;
  pending_.turn_rad += turn.turn_rad;
  pending_.variance += turn.sigma_rad * turn.sigma_rad;
  pending_.bias_rad += turn.bias_rad;
  if (std::abs(pending_.way_m) >= parameters_.bin_m) use_pending();
}

void TrackChooser::stand(const Turn& turn) {
  if (turn.sensor != sensor_ || !(turn.sigma_rad > 0)) return;
  const double noise = turn.sigma_rad * turn.sigma_rad;
  for (auto& hypothesis : hypotheses_) {
    for (auto& cell : hypothesis.cells)
      learn_bias(cell, turn.turn_rad - turn.bias_rad * cell.bias, noise, turn.bias_rad);
  }
}

void TrackChooser::move_blind(double way_m) {
  if (hypotheses_.empty()) return;
  cells_m_ += pending_.way_m + way_m;
  pending_ = {};
  place_m_ += way_m;
  lost_m_ += std::abs(way_m);
  run_pictures(way_m);
  for (auto& hypothesis : hypotheses_) spread(hypothesis, way_m);
  trim();
  extend();
  fit_cells();
}

void TrackChooser::use_pending() {
  const Pending bin = pending_;
  pending_ = {};
  cells_m_ += bin.way_m;
  trim();
  extend();
  fit_cells();
  for (auto& hypothesis : hypotheses_) {
    spread(hypothesis, bin.way_m);
    weigh_turn(hypothesis, bin);
  }
  merge();
  prune();
}

// Every cell is one place of the train and carries the bias that fits best there.
void TrackChooser::weigh_turn(Hypothesis& hypothesis, const Pending& bin) const {
  const double measured = bin.turn_rad / bin.way_m;
  const double sensor = kNoiseShare * bin.variance / (bin.way_m * bin.way_m);
  const double body = parameters_.noise_per_m * parameters_.noise_per_m;
  const double bias_to_curvature = bin.bias_rad / bin.way_m;
  const double end_m = cells_m_ + kCellM * static_cast<double>(hypothesis.cells.size());
  const CurvatureSums track(hypothesis.route, cells_m_ - kHalfBodyM - 3 - std::abs(bin.way_m),
                            end_m + kHalfBodyM + 3 + std::abs(bin.way_m));
  for (size_t i = 0; i < hypothesis.cells.size(); ++i) {
    Cell& cell = hypothesis.cells[i];
    const double middle_m = cells_m_ + kCellM * static_cast<double>(i) - 0.5 * bin.way_m;
    // A short car turns with the track below it, a long one with the mean below its body.
    const double below = track.mean(middle_m - 1, middle_m + 1);
    const double of_body = track.mean(middle_m - kHalfBodyM, middle_m + kHalfBodyM);
    const double mapped = 0.5 * (below + of_body);
    const double rough = std::hypot(parameters_.curvature_share * mapped, 0.5 * (below - of_body));
    // Body and map err over several bins alike: as much less is to be learnt from one.
    const double own = sensor + parameters_.correlated_bins * (body + rough * rough);
    learn_bias(cell, measured - mapped - bias_to_curvature * cell.bias, own, bias_to_curvature);
    cell.log_weight += 0.5 * std::log(sensor + body);
    cell.bias_variance = std::min(1.0, cell.bias_variance + kBiasForgetPerM * std::abs(bin.way_m));
  }
}

// A Kalman filter of one state; how well the measurement fits weighs the cell.
void TrackChooser::learn_bias(Cell& cell, double error, double own_variance, double bias_gain) {
  const double variance = own_variance + bias_gain * bias_gain * cell.bias_variance;
  const double squared = error * error / variance;
  cell.log_weight -= 0.5 * (std::min(squared, kMostSquared) + std::log(variance));
  if (squared > kMostSquared) return;
  const double gain = cell.bias_variance * bias_gain / variance;
  cell.bias += gain * error;
  cell.bias_variance *= std::max(0.0, 1 - gain * bias_gain);
}

void TrackChooser::spread(Hypothesis& hypothesis, double way_m) const {
  const double share = std::min(0.25, 0.5 * std::pow(kDriftPerM * way_m / kCellM, 2));
  if (hypothesis.cells.size() < 3 || share <= 0) return;
  const double most =
      std::max_element(hypothesis.cells.begin(), hypothesis.cells.end(), [](const Cell& a, const Cell& b) {
        return a.log_weight < b.log_weight;
      })->log_weight;
  std::vector<double> weights;
  weights.reserve(hypothesis.cells.size());
  for (const Cell& cell : hypothesis.cells) weights.push_back(std::exp(cell.log_weight - most));
  for (size_t i = 0; i < weights.size(); ++i) {
    const double before = weights[i == 0 ? 0 : i - 1];
    const double after = weights[std::min(i + 1, weights.size() - 1)];
    const double mixed = (1 - 2 * share) * weights[i] + share * (before + after);
    hypothesis.cells[i].log_weight = most + std::log(std::max(mixed, 1e-300));
  }
}

// The cells cover where the train can be; new ones at the ends know no more than their neighbours.
void TrackChooser::fit_cells() {
  const auto ahead = static_cast<int>(std::floor((first_m() - cells_m_) / kCellM));
  cells_m_ += kCellM * ahead;
  const auto count = static_cast<size_t>(std::ceil((last_m() - cells_m_) / kCellM)) + 1;
  for (auto& hypothesis : hypotheses_) {
    auto& cells = hypothesis.cells;
    if (cells.empty()) cells.emplace_back();
    if (ahead > 0) {
      cells.erase(cells.begin(), cells.begin() + std::min<std::ptrdiff_t>(ahead, std::ssize(cells) - 1));
    } else if (ahead < 0) {
      cells.insert(cells.begin(), static_cast<size_t>(-ahead), cells.front());
    }
    cells.resize(count, cells.back());
  }
}

// What lies ahead may be set otherwise once the train has left it: only what it certainly stands on is kept.
void TrackChooser::turn_round() {
  forwards_ = !forwards_;
  moved_back_m_ = 0;
  cells_m_ += pending_.way_m;
  pending_ = {};
  for (auto& hypothesis : hypotheses_) {
    auto& route = hypothesis.route;
    if (forwards_) {
      while (route.legs().size() > 1 && route.legs().back().begin_m > place_m_ - window_.over_m) route.drop_ahead();
    } else {
      while (route.legs().size() > 1 && route.legs().front().end_m() < place_m_ + window_.under_m) route.drop_behind();
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

// Where the train came from matters only for the cells that lie there: the straight way will do.
void TrackChooser::extend_behind(track::Route& route) const {
  while (forwards_ && route.begin_m() > first_m()) {
    const auto ways = ways_->before(route.legs().front().run);
    if (ways.empty()) return;
    route.push_behind(ways.front());
  }
  while (!forwards_ && route.end_m() < last_m()) {
    const auto& ways = ways_->after(route.legs().back().run);
    if (ways.empty()) return;
    route.push_ahead(ways.front());
  }
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

void TrackChooser::merge() {
  const auto same = [](const track::Route& a, const track::Route& b) {
    return std::equal(
        a.legs().begin(), a.legs().end(), b.legs().begin(), b.legs().end(),
        [](const auto& x, const auto& y) { return x.run == y.run && std::abs(x.begin_m - y.begin_m) < kSameM; });
  };
  for (size_t i = 0; i < hypotheses_.size(); ++i) {
    for (size_t k = i + 1; k < hypotheses_.size();) {
      auto& a = hypotheses_[i];
      auto& b = hypotheses_[k];
      if (!same(a.route, b.route)) {
        ++k;
        continue;
      }
      const double of_a = evidence(a);
      const double of_b = evidence(b);
      if (of_b > of_a) std::swap(a, b);
      a.log_prior += log_sum(of_a, of_b) - std::max(of_a, of_b);
      hypotheses_.erase(hypotheses_.begin() + static_cast<std::ptrdiff_t>(k));
    }
  }
}

void TrackChooser::prune() {
  std::vector<double> logs;
  for (const auto& hypothesis : hypotheses_) logs.push_back(evidence(hypothesis));
  const double best = *std::max_element(logs.begin(), logs.end());
  std::vector<double> sorted = logs;
  std::sort(sorted.rbegin(), sorted.rend());
  double least = best + std::log(kLeastProbability);
  if (sorted.size() > kMostHypotheses) least = std::max(least, sorted[kMostHypotheses]);
  std::vector<Hypothesis> kept;
  for (size_t i = 0; i < logs.size(); ++i) {
    if (logs[i] <= least && logs[i] < best) continue;
    kept.push_back(std::move(hypotheses_[i]));
    kept.back().log_prior -= best;
  }
  hypotheses_ = std::move(kept);
}

// Of the train at a place: as fusion says, and up to the lag further back for the turning. Many cars do not lag at all.
double TrackChooser::log_of_place(double place_m) const {
  const double off_m = place_m - place_m_;
  const double beyond_m = off_m > 0 ? off_m : std::min(0.0, off_m + parameters_.lag_m);
  const double sigma_m = std::hypot(window_.sigma_m, parameters_.map_sigma_m);
  const auto bell = [&](double m) { return -0.5 * m * m / (sigma_m * sigma_m); };
  const double at_once = kNoLagShare / (1 - kNoLagShare) * parameters_.lag_m / (2.5 * sigma_m);
  return log_sum(bell(beyond_m), std::log(at_once + 1e-9) + bell(off_m));
}

double TrackChooser::evidence(const Hypothesis& hypothesis) const {
  return hypothesis.log_prior + log_sum(hypothesis.pictures.own, hypothesis.pictures.astray) + of_turning(hypothesis);
}

double TrackChooser::of_turning(const Hypothesis& hypothesis) const {
  std::vector<double> logs;
  logs.reserve(hypothesis.cells.size());
  double prior = 0;
  for (size_t i = 0; i < hypothesis.cells.size(); ++i) {
    const double of_place = log_of_place(cells_m_ + kCellM * static_cast<double>(i));
    logs.push_back(hypothesis.cells[i].log_weight + of_place);
    prior += std::exp(of_place);
  }
  const double most = *std::max_element(logs.begin(), logs.end());
  double sum = 0;
  for (const double log : logs) sum += std::exp(log - most);
  return most + std::log(sum / std::max(prior, 1e-300));
}

double TrackChooser::sighting_fits(const track::Route& route, const Sighting& sighting) const {
  const double seen_m = place_m_ + sighting.distance_ahead_m;
  const double sigma_m = std::hypot(sighting.sigma_m, window_.sigma_m, parameters_.map_sigma_m);
  const bool sided = std::abs(sighting.lateral_m) > kSideM;
  double density = parameters_.false_per_m + (1 - std::clamp(sighting.confidence, 0.0, 1.0)) / (6 * sigma_m);
  for (const auto& leg : route.legs()) {
    if (leg.begin_m > seen_m + 5 * sigma_m || leg.end_m() < seen_m - 5 * sigma_m) continue;
    for (const auto* landmark : map_->landmarks_on(leg.run.edge->id)) {
      const bool turned = !leg.run.forward;
      auto kind = landmark->kind;
      if (turned && kind == track::LandmarkKind::portal_in) {
        kind = track::LandmarkKind::portal_out;
      } else if (turned && kind == track::LandmarkKind::portal_out) {
        kind = track::LandmarkKind::portal_in;
      }
      if (kind != sighting.kind) continue;
      const double at_m = leg.begin_m + (turned ? leg.run.length_m() - landmark->offset_m : landmark->offset_m);
      const double z = (at_m - seen_m) / sigma_m;
      const double lateral_m = turned ? -landmark->lateral_m : landmark->lateral_m;
      double side = 1;
      if (sided && std::abs(lateral_m) > kSideM) {
        side = (lateral_m > 0) == (sighting.lateral_m > 0) ? 1 - parameters_.wrong_side : parameters_.wrong_side;
      }
      density += parameters_.detection * sighting.confidence * side * std::exp(-0.5 * z * z) /
                 (sigma_m * std::sqrt(2 * std::numbers::pi));
    }
  }
  return density;
}

// Astray, the pictures show one of the other ways.
void TrackChooser::use_picture(const std::vector<double>& log_fits) {
  for (size_t i = 0; i < hypotheses_.size(); ++i) {
    double other = -INFINITY;
    for (size_t k = 0; k < log_fits.size(); ++k) {
      if (k != i) other = std::max(other, log_fits[k]);
    }
    hypotheses_[i].pictures.own += log_fits[i];
    hypotheses_[i].pictures.astray += other;
  }
}

// A detector goes astray and comes back, as often as `astray` and `astray_m` say.
void TrackChooser::run_pictures(double way_m) {
  seen_m_ += std::abs(way_m);
  const double back = std::min(0.5, std::abs(way_m) / parameters_.astray_m);
  const double away = back * parameters_.astray / (1 - parameters_.astray);
  for (auto& [route, prior, pictures, cells] : hypotheses_) {
    pictures = {log_sum(pictures.own + std::log(1 - away), pictures.astray + std::log(back)),
                log_sum(pictures.own + std::log(away), pictures.astray + std::log(1 - back))};
  }
}

void TrackChooser::sight(const Sighting& sighting) {
  if (hypotheses_.size() < 2) return;
  std::vector<double> fits;
  for (const auto& hypothesis : hypotheses_) fits.push_back(std::log(sighting_fits(hypothesis.route, sighting)));
  use_picture(fits);
  prune();
}

// The picture is taken where the train really is, anywhere in the window: what fits one of these places fits.
double TrackChooser::view_fits(const track::Route& route, double curvature_per_m, double sigma_per_m) const {
  double least = INFINITY;
  double most = -INFINITY;
  const double end_m = last_m() + parameters_.view_to_m;
  for (double m = place_m_ - window_.over_m - 2 + parameters_.view_from_m; m < end_m + kViewStepM; m += kViewStepM) {
    const double mapped = route.curvature_at(std::min(m, end_m));
    const double rough = parameters_.curvature_share * std::abs(mapped);
    least = std::min(least, mapped - rough);
    most = std::max(most, mapped + rough);
  }
  const double beyond = std::max({0.0, least - curvature_per_m, curvature_per_m - most});
  return -0.5 * std::min(kMostSquared, beyond * beyond / (sigma_per_m * sigma_per_m)) / parameters_.correlated_bins;
}

void TrackChooser::see(double curvature_per_m, double sigma_per_m) {
  if (hypotheses_.size() < 2 || seen_m_ < parameters_.bin_m) return;
  seen_m_ = 0;
  const double sigma = std::hypot(sigma_per_m, parameters_.noise_per_m);
  std::vector<double> fits;
  for (const auto& hypothesis : hypotheses_) fits.push_back(view_fits(hypothesis.route, curvature_per_m, sigma));
  use_picture(fits);
}

std::optional<TrackChoice> TrackChooser::choice() const {
  if (hypotheses_.empty()) return std::nullopt;
  if (hypotheses_.size() == 1) {
    return TrackChoice{{{hypotheses_.front().route.position_at(place_m_), 1.0}}, true};
  }
  struct Sum {
    track::EdgePosition place;
    double log = -INFINITY;
  };
  std::map<std::pair<uint32_t, track::Direction>, Sum> by_edge;
  double all = -INFINITY;
  for (const auto& hypothesis : hypotheses_) {
    const double log = evidence(hypothesis);
    const auto place = hypothesis.route.position_at(place_m_);
    auto& sum = by_edge[{place.edge, place.direction}];
    sum.place = place;
    sum.log = log_sum(sum.log, log);
    all = log_sum(all, log);
  }
  TrackChoice choice;
  for (const auto& [edge, sum] : by_edge) choice.options.push_back({sum.place, std::exp(sum.log - all)});
  std::sort(choice.options.begin(), choice.options.end(),
            [](const TrackOption& a, const TrackOption& b) { return a.probability > b.probability; });
  choice.known = choice.options.front().probability >= parameters_.declare;
  return choice;
}

}  // namespace railfix::map_matcher
