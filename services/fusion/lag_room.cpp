#include "fusion/lag_room.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>
#include <utility>

#include "core/time.hpp"

namespace railfix::fusion {
namespace {

constexpr double kKnownS = 0.01;      // sigma of a lag that is known
constexpr double kTripSigmaS = 0.02;  // a camera that is started anew may have another one
constexpr double kLikelyLate = 1.0;   // sigmas of one that the measurements speak for ...
constexpr double kLikelyEarly = 2.0;  // ... which a camera seldom is
constexpr double kSure = 3.0;         // of one that is sure
constexpr double kBeginsS = 1.0;
constexpr double kSameM = 0.1;

void degrade(TrainEstimate& estimate, double lag_s) {
  char text[160];
  std::snprintf(
      text, sizeof text,
      "camera stamps %.2f s %s against the wheel's: check live.latency_ms, live.line_latency_ms and the clocks",
      std::abs(lag_s), lag_s > 0 ? "late" : "early");
  estimate.degrade(text);
}

}  // namespace

void LagRoom::begin_with(const std::optional<CameraLag::Lag>& before, const FusionParameters& parameters) {
  if (before && std::abs(before->late_s) < parameters.camera_lag_s) before_ = before;
}

void LagRoom::add(const OdometryInput& step) {
  measured_.add(step);
  if (measured_.has_jumped()) before_.reset();
}

bool LagRoom::fits_before(const CameraLag::Lag& measured) const {
  return before_ && std::abs(measured.late_s - before_->late_s) < 2 * measured.sigma_s;
}

std::optional<CameraLag::Lag> LagRoom::lag() const {
  const auto measured = measured_.lag();
  if (!measured || measured->sigma_s <= kTripSigmaS || !fits_before(*measured)) return measured;
  return CameraLag::Lag{before_->late_s, std::hypot(before_->sigma_s, kTripSigmaS)};
}

std::optional<CameraLag::Lag> LagRoom::to_keep(const FusionParameters& parameters) const {
  const auto measured = measured_.lag();
  if (measured && measured->sigma_s < kKnownS)
    return std::abs(measured->late_s) < parameters.camera_lag_s ? measured : std::nullopt;
  return !measured || fits_before(*measured) ? before_ : std::nullopt;
}

LagRoom::Speeds LagRoom::speeds_since_sure(const TrainEstimate& estimate) {
  if (!std::isnan(estimate.speed_mps)) last_speed_mps_ = estimate.speed_mps;
  // A train that only comes back towards it, or rocks at a halt, has none that is new.
  const double run_m = std::abs(estimate.distance_m - std::exchange(distance_m_, estimate.distance_m));
  if (estimate.since_sure_m < since_sure_m_ - run_m - kSameM) {
    speeds_before_ = speeds_;
    speeds_ = {last_speed_mps_, last_speed_mps_};
  }
  since_sure_m_ = estimate.since_sure_m;
  speeds_.slowest_mps = std::min(speeds_.slowest_mps, last_speed_mps_);
  speeds_.fastest_mps = std::max(speeds_.fastest_mps, last_speed_mps_);
  return {std::min(speeds_.slowest_mps, speeds_before_.slowest_mps),
          std::max(speeds_.fastest_mps, speeds_before_.fastest_mps)};
}

bool LagRoom::begins_with_the_wheel(const TrainEstimate& estimate) {
  if (!begun_ns_) begun_ns_ = estimate.stamp_ns;
  const double since_s = core::seconds(estimate.stamp_ns - *begun_ns_);
  return since_s >= 0 && since_s < kBeginsS && measured_.has_wheel_only();
}

void LagRoom::widen(TrainEstimate& estimate, const FusionParameters& p) {
  const Speeds speeds = speeds_since_sure(estimate);
  const auto held = begins_with_the_wheel(estimate) ? std::optional(CameraLag::unknown()) : lag();
  if (!held) return;
  const double spread_s = 2 * held->sigma_s;
  const bool is_sure = std::abs(held->late_s) > std::max(p.camera_lag_s + spread_s, kSure * held->sigma_s);
  const double bare_over_m = estimate.over_m;
  const double bare_under_m = estimate.under_m;
  const double allowed_m = p.allowed_m(estimate.since_sure_m);
  const bool has_width_to_lose = std::max(bare_over_m, bare_under_m) <= allowed_m;
  // Stamps that are late so much, or early where it is below 0: the train is further on, or not so far.
  const auto hold = [&](double late_s) {
    const bool is_likely = is_sure || (late_s > 0 ? held->late_s > kLikelyLate * held->sigma_s
                                                  : -held->late_s > kLikelyEarly * held->sigma_s);
    const bool is_bounded = !is_likely && has_width_to_lose && estimate.integrity != Integrity::unusable;
    const double most_m = is_bounded ? allowed_m : std::numeric_limits<double>::infinity();
    const auto [behind_m, ahead_m] = std::minmax({late_s * speeds.slowest_mps, late_s * speeds.fastest_mps});
    const double over_m = bare_over_m + std::max(0.0, -behind_m);
    const double under_m = bare_under_m + std::max(0.0, ahead_m);
    estimate.over_m = std::max(estimate.over_m, std::min(over_m, most_m));
    estimate.under_m = std::max(estimate.under_m, std::min(under_m, most_m));
  };
  const double room_s = is_sure ? 0 : p.camera_lag_s;  // what every interval has
  if (const double late_s = held->late_s + spread_s - room_s; late_s > 0) hold(late_s);
  if (const double early_s = spread_s - held->late_s - room_s; early_s > 0) hold(-early_s);
  estimate.judge_width(p);
  if (is_sure) degrade(estimate, held->late_s);
}

}  // namespace railfix::fusion
