#include "fusion/lag_room.hpp"

#include <cmath>
#include <cstdio>
#include <limits>

namespace railfix::fusion {
namespace {

constexpr double kKnownS = 0.01;      // sigma of a lag that is known
constexpr double kTripSigmaS = 0.02;  // a camera that is started anew may have another one
constexpr double kLikely = 1.0;       // sigmas of one that the measurements speak for
constexpr double kSure = 3.0;         // ... and of one that is

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
  if (before && std::abs(before->s) < parameters.camera_lag_s) before_ = before;
}

bool LagRoom::fits_before(const CameraLag::Lag& measured) const {
  return before_ && std::abs(measured.s - before_->s) < 2 * measured.sigma_s;
}

std::optional<CameraLag::Lag> LagRoom::lag() const {
  const auto measured = measured_.lag();
  if (!measured || measured->sigma_s <= kTripSigmaS || !fits_before(*measured)) return measured;
  return CameraLag::Lag{before_->s, std::hypot(before_->sigma_s, kTripSigmaS)};
}

std::optional<CameraLag::Lag> LagRoom::to_keep(const FusionParameters& parameters) const {
  const auto measured = measured_.lag();
  if (measured && measured->sigma_s < kKnownS)
    return std::abs(measured->s) < parameters.camera_lag_s ? measured : std::nullopt;
  return !measured || fits_before(*measured) ? before_ : std::nullopt;
}

LagRoom::Speeds LagRoom::speeds_since_sure(const TrainEstimate& estimate) {
  if (!std::isnan(estimate.speed_mps)) last_speed_mps_ = estimate.speed_mps;
  if (estimate.since_sure_m < since_sure_m_) {
    speeds_before_ = speeds_;
    speeds_ = {last_speed_mps_, last_speed_mps_};
  }
  since_sure_m_ = estimate.since_sure_m;
  speeds_.slowest_mps = std::min(speeds_.slowest_mps, last_speed_mps_);
  speeds_.fastest_mps = std::max(speeds_.fastest_mps, last_speed_mps_);
  return {std::min(speeds_.slowest_mps, speeds_before_.slowest_mps),
          std::max(speeds_.fastest_mps, speeds_before_.fastest_mps)};
}

void LagRoom::widen(TrainEstimate& estimate, const FusionParameters& p) {
  const Speeds speeds = speeds_since_sure(estimate);
  const auto held = lag();
  if (!held) return;
  const double off_s = std::abs(held->s);
  const bool is_sure = off_s > std::max(p.camera_lag_s + 2 * held->sigma_s, kSure * held->sigma_s);
  const double beyond_s = held->s + 2 * held->sigma_s - p.camera_lag_s;  // what every interval has room for
  if (!is_sure && beyond_s < 0) return;
  const double late_s = is_sure ? std::copysign(off_s + 2 * held->sigma_s, held->s) : beyond_s;
  const bool is_likely = is_sure || held->s > kLikely * held->sigma_s;
  const bool is_bounded = !is_likely && estimate.integrity != Integrity::unusable;
  const double most_m = is_bounded ? p.allowed_m(estimate.since_sure_m) : std::numeric_limits<double>::infinity();
  const auto make_room = [&](double& side_m, double way_m) {
    side_m = std::max(side_m, std::min(side_m + std::max(0.0, way_m), most_m));
  };
  make_room(estimate.under_m, late_s * (late_s > 0 ? speeds.fastest_mps : speeds.slowest_mps));
  make_room(estimate.over_m, -late_s * (late_s > 0 ? speeds.slowest_mps : speeds.fastest_mps));
  estimate.judge_width(p);
  if (is_sure) degrade(estimate, held->s);
}

}  // namespace railfix::fusion
