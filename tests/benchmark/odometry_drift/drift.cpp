#include "drift.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>

#include "core/time.hpp"

namespace railfix {
namespace {

constexpr double kWindowM = 100.0;
constexpr double kRestM = 1e-4;                      // less motion from picture to picture is rest
constexpr double kFalseRestM = 0.004;                // longer true motion without a measured one is a false standstill
constexpr int64_t kSettlingNs = core::kNsPerSecond;  // after a halt
constexpr double kShortStepM = 0.25;                 // from the reference; behind a stop
constexpr size_t kRemembered = 400;

double quantile(std::vector<double> values, double share) {
  if (values.empty()) return 0;
  const auto at = values.begin() + static_cast<std::ptrdiff_t>(share * static_cast<double>(values.size() - 1));
  std::nth_element(values.begin(), at, values.end());
  return *at;
}

double mean(const std::vector<double>& values) {
  double sum = 0;
  for (const double value : values) sum += value;
  return values.empty() ? 0 : sum / static_cast<double>(values.size());
}

double root_mean_square(std::vector<double> values) {
  for (double& value : values) value *= value;
  return std::sqrt(mean(values));
}

double both_sides_99(const std::vector<double>& values) {
  return std::max(quantile(values, 0.995), -quantile(values, 0.005));
}

}  // namespace

void Drift::add(const dataset::TruthRow& truth, const odometry::MouseStep& step, double seconds) {
  ++pictures_;
  seconds_.push_back(seconds);
  true_distance_.emplace_back(step.stamp_ns, truth.distance_m);
  if (true_distance_.size() > kRemembered) true_distance_.erase(true_distance_.begin(), true_distance_.begin() + 100);
  if (!step.valid) return;
  ++valid_;
  if (begun_) {
    compare(truth.distance_m - last_truth_m_, step);
  } else {
    begun_ = true;
    first_error_m_ = mark_error_m_ = step.distance_m - truth.distance_m;
    mark_m_ = still_since_truth_m_ = truth.distance_m;
  }
  last_truth_m_ = truth.distance_m;
  last_m_ = step.distance_m;
  if (std::abs(truth.distance_m - mark_m_) >= kWindowM) close_window(truth, step);
}

void Drift::compare(double true_step_m, const odometry::MouseStep& step) {
  const double moved_m = step.distance_m - last_m_;
  squared_m2_ += (moved_m - true_step_m) * (moved_m - true_step_m);
  travelled_m_ += std::abs(true_step_m);
  ++steps_;
  if (std::abs(true_step_m) >= kRestM) {
    rest_begin_ns_ = 0;
  } else if (rest_begin_ns_ == 0) {
    rest_begin_ns_ = step.stamp_ns;
  } else if (step.stamp_ns - rest_begin_ns_ > kSettlingNs) {
    ++at_rest_;
    rest_moved_m_ += std::abs(moved_m);
    if (moved_m != 0) ++moved_at_rest_;
  }
  const double truth_m = last_truth_m_ + true_step_m;
  if (moved_m != 0) still_since_truth_m_ = truth_m;
  const double still_m = std::abs(truth_m - still_since_truth_m_);
  if (still_m > kFalseRestM) ++false_rest_;
  longest_false_rest_m_ = std::max(longest_false_rest_m_, still_m);
  for (const auto& [stamp_ns, distance_m] : true_distance_) {
    if (stamp_ns != step.reference_stamp_ns || step.step_sigma_m <= 0) continue;
    const double normalised = (step.step_m - (truth_m - distance_m)) / step.step_sigma_m;
    normalised_.push_back(normalised);
    if (std::abs(step.step_m) < kShortStepM && true_step_m != 0) normalised_short_.push_back(normalised);
  }
}

void Drift::close_window(const dataset::TruthRow& truth, const odometry::MouseStep& step) {
  const double error_m = step.distance_m - truth.distance_m;
  const double length_m = std::abs(truth.distance_m - mark_m_);
  const double percent = 100.0 * (error_m - mark_error_m_) / length_m;
  window_percent_.push_back(std::abs(percent));
  if (print_windows_) {
    std::printf("%8.1f m  %+.3f %%  total %+8.3f m  speed %5.2f m/s  pitch bias %+.3f mrad  ballast %.1f mm\n",
                truth.distance_m, percent, error_m - first_error_m_, step.speed_mps, 1e3 * step.pitch_bias_rad,
                1e3 * step.ballast_depth_m);
    std::fflush(stdout);
  }
  mark_m_ = truth.distance_m;
  mark_error_m_ = error_m;
}

void Drift::print() const {
  const double error_m = last_m_ - last_truth_m_ - first_error_m_;
  std::printf("pictures %zu, valid %.2f %%, travelled %.1f m, drift %+.3f m = %+.4f %%\n", pictures_,
              100.0 * static_cast<double>(valid_) / static_cast<double>(std::max<size_t>(1, pictures_)), travelled_m_,
              error_m, 100.0 * error_m / std::max(1.0, travelled_m_));
  std::printf("windows of 100 m: mean %.3f %%, p95 %.3f %%, worst %.3f %% of %zu\n", mean(window_percent_),
              quantile(window_percent_, 0.95), quantile(window_percent_, 1.0), window_percent_.size());
  std::printf(
      "step error %.2f mm (1 sigma); normalised by its sigma: rms %.2f, p99 %.2f; "
      "moving, below 0.25 m: rms %.2f, p99 %.2f of %zu\n",
      1e3 * std::sqrt(squared_m2_ / static_cast<double>(std::max<size_t>(1, steps_))), root_mean_square(normalised_),
      both_sides_99(normalised_), root_mean_square(normalised_short_), both_sides_99(normalised_short_),
      normalised_short_.size());
  std::printf(
      "at rest for more than a second %zu pictures, moved in %zu by %.3f m; standstill said too long in %zu, "
      "longest over %.1f mm\n",
      at_rest_, moved_at_rest_, rest_moved_m_, false_rest_, 1e3 * longest_false_rest_m_);
  std::printf("processor time a picture: mean %.2f ms, p50 %.2f, p99 %.2f\n", 1e3 * mean(seconds_),
              1e3 * quantile(seconds_, 0.5), 1e3 * quantile(seconds_, 0.99));
}

}  // namespace railfix
