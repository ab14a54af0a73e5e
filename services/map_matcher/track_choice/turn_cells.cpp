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
constexpr double kSwaySpeedMps = 20.0;    // the sway grows with the speed

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

/// A Kalman filter of the errors of turning: what the body has swayed to the one side within a bin it sways back in the
/// next ones, so that little of it is left over a longer way.
class TurnErrorModel {
 public:
  TurnErrorModel(const BinTurn& bin, const TrackParameters& parameters)
      : forgotten_(kBiasForgetPerM * std::abs(bin.way_m) + bin.bias_walk) {
    const bool timed = bin.duration_s > 0;
    const double speed_mps = timed ? std::abs(bin.way_m) / bin.duration_s : kSwaySpeedMps;
    const double sway_rad = bin.way_m == 0 ? 0 : parameters.sway_rad * speed_mps / kSwaySpeedMps;
    keeps_ << 1, (timed ? std::exp(-bin.duration_s / parameters.sway_s) : 0.0);
    fresh_ = sway_rad * sway_rad * (1 - keeps_[1] * keeps_[1]);
    seen_ << bin.bias_rad, keeps_[1] - 1;
  }
  /// `turned_rad`: more than the track. How well it fits weighs the cell.
  void weigh(TurnCell& cell, double turned_rad, double noise) const {
    for (TurnFit& fit : cell.fits) {
      if (std::isfinite(fit.log_weight)) weigh(fit, turned_rad, noise);
    }
  }

 private:
  void weigh(TurnFit& fit, double turned_rad, double noise) const {
    auto& [mean, covariance] = fit.errors;
    const double error = turned_rad - seen_.dot(mean);
    const Eigen::Vector2d together = covariance * seen_;
    const double variance = noise + fresh_ + seen_.dot(together);
    const double squared = error * error / variance;
    fit.log_weight -= 0.5 * (std::min(squared, kMostSquared) + std::log(variance));
    Eigen::Vector2d of_errors = keeps_.cwiseProduct(together);
    of_errors[TurnErrors::sway] += fresh_;
    mean = keeps_.cwiseProduct(mean);
    covariance = keeps_.asDiagonal() * covariance * keeps_.asDiagonal();
    covariance(TurnErrors::sway, TurnErrors::sway) += fresh_;
    if (squared <= kMostSquared) {
      mean += error / variance * of_errors;
      covariance -= of_errors * of_errors.transpose() / variance;
    }
    // Joined cells may know less than 1; less alone would contradict what goes with it.
    double& bias = covariance(TurnErrors::bias, TurnErrors::bias);
    if (bias < 1) bias = std::min(1.0, bias + forgotten_);
  }

  Eigen::Vector2d keeps_;  // of the errors, over the bin
  Eigen::Vector2d seen_;   // what is measured of the errors that the bin begins with
  double fresh_;           // variance of the sway that is new
  double forgotten_;       // variance of the bias
};

}  // namespace

// Every cell is one place of the train and carries the errors that fit best there.
void weigh_turn(std::vector<TurnCell>& cells, double first_m, const track::Route& route, const BinTurn& bin,
                const TrackParameters& parameters) {
  const double sensor = kNoiseShare * bin.variance;
  const double body = std::pow(parameters.noise_per_m * bin.way_m, 2);
  const double usual_log = 0.5 * std::log(sensor + body);
  const TurnErrorModel model(bin, parameters);
  const double end_m = first_m + kCellM * static_cast<double>(cells.size());
  const CurvatureSums track(route, first_m - kHalfBodyM - 3 - std::abs(bin.way_m),
                            end_m + kHalfBodyM + 3 + std::abs(bin.way_m));
  for (size_t i = 0; i < cells.size(); ++i) {
    const double middle_m = first_m + kCellM * static_cast<double>(i) - 0.5 * bin.way_m;
    // A short car turns with the track below it, a long one with the mean below its body.
    const double below = track.mean(middle_m - 1, middle_m + 1);
    const double of_body = track.mean(middle_m - kHalfBodyM, middle_m + kHalfBodyM);
    const double mapped = 0.5 * (below + of_body);
    const double rough = bin.way_m * std::hypot(parameters.curvature_share * mapped, 0.5 * (below - of_body));
    // The map errs over several bins alike: as much less is to be learnt from one.
    const double noise = sensor + body + parameters.correlated_bins * rough * rough;
    model.weigh(cells[i], bin.turn_rad - bin.way_m * mapped, noise);
    cells[i].add_log(usual_log);
  }
}

double log_sum(double a, double b) {
  const double most = std::max(a, b);
  if (!std::isfinite(most)) return most;
  return most + std::log1p(std::exp(std::min(a, b) - most));
}

void weigh_stand(TurnCell& cell, const BinTurn& stood, const TrackParameters& parameters) {
  TurnErrorModel(stood, parameters).weigh(cell, stood.turn_rad, stood.variance);
}

double TurnCell::log_weight() const {
  double log = -INFINITY;
  for (const TurnFit& fit : fits) log = log_sum(log, fit.log_weight);
  return log;
}

void TurnCell::add_log(double log) {
  for (TurnFit& fit : fits) fit.log_weight += log;
}

void TurnCell::forget(TurnErrors::Index error) {
  for (TurnFit& fit : fits) fit.errors.forget(error);
}

void TurnCell::begin_sensor() {
  TurnFit now{log_weight(), fits.front().errors};
  now.errors.forget(TurnErrors::bias);
  fits = {now};
}

void begin_jump(TurnCell& cell, size_t fit, const BinTurn& bin, double chance) {
  if (!(bin.bias_rad > 0)) return;
  TurnFit& jumped = cell.fits[fit];
  jumped = cell.fits.front();
  jumped.log_weight += std::log(chance);
  jumped.errors.covariance(TurnErrors::bias, TurnErrors::bias) += std::pow(bin.jump_rad / bin.bias_rad, 2);
}

namespace {

// The mean and covariance of a mixture.
void join_fits(TurnFit& into, double log_into, const TurnFit& other, double log_other) {
  const double mine = log_into + into.log_weight;
  const double its = log_other + other.log_weight;
  const double both = log_sum(mine, its);
  const double share = std::isfinite(both) ? std::exp(mine - both) : 1;
  const Eigen::Vector2d mean = share * into.errors.mean + (1 - share) * other.errors.mean;
  const auto about_mean = [&](const TurnErrors& errors) -> Eigen::Matrix2d {
    return errors.covariance + (errors.mean - mean) * (errors.mean - mean).transpose();
  };
  const Eigen::Matrix2d covariance = share * about_mean(into.errors) + (1 - share) * about_mean(other.errors);
  into = {both - log_sum(log_into, log_other), {mean, covariance}};
}

}  // namespace

void join_cells(TurnCell& into, double log_into, const TurnCell& other, double log_other) {
  for (size_t i = 0; i < TurnCell::kFits; ++i) join_fits(into.fits[i], log_into, other.fits[i], log_other);
}

void TurnErrors::forget(Index error) {
  mean[error] = 0;
  covariance.row(error).setZero();
  covariance.col(error).setZero();
  covariance(error, error) = TurnErrors().covariance(error, error);
}

void spread(std::vector<TurnCell>& cells, double way_m) {
  const double share = std::min(0.25, 0.5 * std::pow(kDriftPerM * way_m / kCellM, 2));
  if (cells.size() < 3 || share <= 0) return;
  std::vector<double> before(cells.size());
  for (size_t fit = 0; fit < TurnCell::kFits; ++fit) {
    std::ranges::transform(cells, before.begin(), [fit](const TurnCell& cell) { return cell.fits[fit].log_weight; });
    const double most = *std::ranges::max_element(before);
    if (!std::isfinite(most)) continue;
    const auto weight = [&](size_t i) { return std::exp(before[std::min(i, before.size() - 1)] - most); };
    for (size_t i = 0; i < cells.size(); ++i) {
      const double mixed = (1 - 2 * share) * weight(i) + share * (weight(i == 0 ? 0 : i - 1) + weight(i + 1));
      cells[i].fits[fit].log_weight = most + std::log(std::max(mixed, 1e-300));
    }
  }
}

}  // namespace railfix::map_matcher
