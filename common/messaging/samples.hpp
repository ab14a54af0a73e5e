// What parts of a sample mean that its type alone does not say.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <span>

#include "idl/odometry.h"
#include "idl/position.h"
#include "idl/track.h"

namespace railfix::messaging {

/// Of curvature_per_m in a track_view's covariance: the upper triangle, row by row.
inline constexpr size_t kCurvatureVariance = 25;

/// The view tells where the rails are. One that is not a number anywhere tells nothing: what averages it never gets
/// rid of it.
inline bool has_seen(const msg::TrackView& view) {
  if (view.seen_left() == 0 && view.seen_right() == 0) return false;
  const auto& variances = view.covariance();
  return std::isfinite(view.roll_rad()) && std::isfinite(view.pitch_rad()) && std::isfinite(view.yaw_rad()) &&
         std::isfinite(view.lateral_m()) && std::isfinite(view.height_m()) && std::isfinite(view.curvature_per_m()) &&
         std::isfinite(view.vertical_curvature_per_m()) &&
         std::all_of(variances.begin(), variances.end(), [](double one) { return std::isfinite(one); });
}

/// The step tells how the train moved.
inline bool has_measured(const msg::OdometryStep& step) {
  return step.valid() != 0 && step.mode() != msg::ODOMETRY_BLIND;
}

/// Message 136 as far as it is filled. It lives in the report.
inline std::span<const uint8_t> bytes_of(const msg::TrainPositionReport& report) {
  return std::span(report.message()).first(std::min<size_t>(report.message_bytes(), report.message().size()));
}

}  // namespace railfix::messaging
