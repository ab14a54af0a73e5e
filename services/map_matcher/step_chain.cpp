#include "map_matcher/step_chain.hpp"

#include <algorithm>
#include <cmath>

#include "core/time.hpp"

namespace railfix::map_matcher {
namespace {

constexpr double kSameWayM = 0.5;      // two counts of one way differ by less than this ...
constexpr double kSameWayShare = 0.5;  // ... and this share of it

}  // namespace

void StepChain::add(const StepInput& step) {
  const auto way_m = way_to(step);
  broken_ = !way_m;
  turn_.reset();
  if (way_m) {
    odometer_m_ += *way_m;
    if (linked(step)) turn_ = turn_to(step, *way_m);
    if (turn_ && !std::isfinite(turn_->turn_rad + turn_->sigma_rad)) turn_.reset();
  }
  last_ = step;
}

bool StepChain::linked(const StepInput& step) const {
  return step.reference_stamp_ns <= last_->stamp_ns;
}

// The distances tell it best, but only those of one process: pictures that the two steps have in common, or else the
// speed, tell whether they are.
std::optional<double> StepChain::way_to(const StepInput& step) const {
  if (!last_ || !last_->measured || !step.measured || step.stamp_ns <= last_->stamp_ns) return std::nullopt;
  const double dt_s = core::seconds(step.stamp_ns - last_->stamp_ns);
  double expected_m = 0.5 * (last_->speed_mps + step.speed_mps) * dt_s;
  if (step.reference_stamp_ns == last_->reference_stamp_ns) {
    expected_m = step.step_m - last_->step_m;
  } else if (linked(step)) {
    expected_m = step.step_m * dt_s / core::seconds(step.stamp_ns - step.reference_stamp_ns);
  }
  const double counted_m = step.distance_m - last_->distance_m;
  if (std::abs(counted_m - expected_m) <= kSameWayM + kSameWayShare * std::abs(expected_m)) return counted_m;
  return linked(step) && std::isfinite(expected_m) ? std::optional(expected_m) : std::nullopt;
}

// Key frames overlap: what counts is how the turn since the same picture grew.
Turn StepChain::turn_to(const StepInput& step, double way_m) const {
  Turn turn;
  turn.way_m = way_m;
  turn.duration_s = core::seconds(step.stamp_ns - last_->stamp_ns);
  turn.sigma_rad = std::hypot(step.yaw_sigma_rad, kYawNoiseRad);
  const double part = step.step_m == 0 ? 1.0 : std::clamp(way_m / step.step_m, -1.0, 1.0);
  if (step.reference_stamp_ns != last_->reference_stamp_ns) {
    turn.turn_rad = part * step.yaw_rad;
  } else {
    turn.turn_rad = step.yaw_rad - last_->yaw_rad;
    turn.sigma_rad *= std::sqrt(std::abs(part));
  }
  return turn;
}

}  // namespace railfix::map_matcher
