#include "map_matcher/track_choice/turn_cells.hpp"

#include <algorithm>
#include <cmath>

namespace railfix::map_matcher {
namespace {

constexpr double kDriftPerM = 0.07;       // a bin's way may be so wrong, for the spreading of the cells
constexpr double kMostSquared = 12.0;     // a bin that fits worse than this is not believed more
constexpr double kNoiseShare = 1.5;       // no sensor knows its own noise better
constexpr double kHalfBodyM = 8.0;        // a long car turns with the mean of the track below it
constexpr double kBiasForgetPerM = 5e-4;  // the sensor's bias may be another one after some kilometres

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

// Every cell is one place of the train and carries the bias that fits best there.
void weigh_turn(std::vector<TurnCell>& cells, double first_m, const track::Route& route, const BinTurn& bin,
                const TrackParameters& parameters) {
  const double measured = bin.turn_rad / bin.way_m;
  const double sensor = kNoiseShare * bin.variance / (bin.way_m * bin.way_m);
  const double body = parameters.noise_per_m * parameters.noise_per_m;
  const double bias_to_curvature = bin.bias_rad / bin.way_m;
  const double end_m = first_m + kCellM * static_cast<double>(cells.size());
  const CurvatureSums track(route, first_m - kHalfBodyM - 3 - std::abs(bin.way_m),
                            end_m + kHalfBodyM + 3 + std::abs(bin.way_m));
  for (size_t i = 0; i < cells.size(); ++i) {
    TurnCell& cell = cells[i];
    const double middle_m = first_m + kCellM * static_cast<double>(i) - 0.5 * bin.way_m;
    // A short car turns with the track below it, a long one with the mean below its body.
    const double below = track.mean(middle_m - 1, middle_m + 1);
    const double of_body = track.mean(middle_m - kHalfBodyM, middle_m + kHalfBodyM);
    const double mapped = 0.5 * (below + of_body);
    const double rough = std::hypot(parameters.curvature_share * mapped, 0.5 * (below - of_body));
    // Body and map err over several bins alike: as much less is to be learnt from one.
    const double own = sensor + parameters.correlated_bins * (body + rough * rough);
    learn_bias(cell, measured - mapped - bias_to_curvature * cell.bias, own, bias_to_curvature);
    cell.log_weight += 0.5 * std::log(sensor + body);
    loosen_bias(cell, kBiasForgetPerM * std::abs(bin.way_m) + bin.bias_walk);
  }
}

double log_sum(double a, double b) {
  const double most = std::max(a, b);
  if (!std::isfinite(most)) return most;
  return most + std::log1p(std::exp(std::min(a, b) - most));
}

void loosen_bias(TurnCell& cell, double variance) {
  cell.bias_variance = std::min(1.0, cell.bias_variance + variance);
}

// The mean and variance of a mixture.
void join_cells(TurnCell& into, double log_into, const TurnCell& other, double log_other) {
  const double mine = log_into + into.log_weight;
  const double its = log_other + other.log_weight;
  const double both = log_sum(mine, its);
  const double share = std::isfinite(both) ? std::exp(mine - both) : 1;
  const double bias = share * into.bias + (1 - share) * other.bias;
  const auto about_mean = [&](const TurnCell& cell) {
    return cell.bias_variance + (cell.bias - bias) * (cell.bias - bias);
  };
  const double variance = share * about_mean(into) + (1 - share) * about_mean(other);
  into = {both - log_sum(log_into, log_other), bias, std::min(1.0, variance)};
}

// A Kalman filter of one state; how well the measurement fits weighs the cell.
void learn_bias(TurnCell& cell, double error, double own_variance, double bias_gain) {
  const double variance = own_variance + bias_gain * bias_gain * cell.bias_variance;
  const double squared = error * error / variance;
  cell.log_weight -= 0.5 * (std::min(squared, kMostSquared) + std::log(variance));
  if (squared > kMostSquared) return;
  const double gain = cell.bias_variance * bias_gain / variance;
  cell.bias += gain * error;
  cell.bias_variance *= std::max(0.0, 1 - gain * bias_gain);
}

void spread(std::vector<TurnCell>& cells, double way_m) {
  const double share = std::min(0.25, 0.5 * std::pow(kDriftPerM * way_m / kCellM, 2));
  if (cells.size() < 3 || share <= 0) return;
  const double most = std::max_element(cells.begin(), cells.end(), [](const TurnCell& a, const TurnCell& b) {
                        return a.log_weight < b.log_weight;
                      })->log_weight;
  std::vector<double> weights;
  weights.reserve(cells.size());
  for (const TurnCell& cell : cells) weights.push_back(std::exp(cell.log_weight - most));
  for (size_t i = 0; i < weights.size(); ++i) {
    const double before = weights[i == 0 ? 0 : i - 1];
    const double after = weights[std::min(i + 1, weights.size() - 1)];
    const double mixed = (1 - 2 * share) * weights[i] + share * (before + after);
    cells[i].log_weight = most + std::log(std::max(mixed, 1e-300));
  }
}

}  // namespace railfix::map_matcher
