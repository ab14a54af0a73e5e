// What parts of a sample mean that its type alone does not say.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <span>

#include "idl/odometry.h"
#include "idl/position.h"

namespace railfix::messaging {

/// Of curvature_per_m in a track_view's covariance: the upper triangle, row by row.
inline constexpr size_t kCurvatureVariance = 25;

/// The step tells how the train moved.
inline bool has_measured(const msg::OdometryStep& step) {
  return step.valid() != 0 && step.mode() != msg::ODOMETRY_BLIND;
}

/// Message 136 as far as it is filled. It lives in the report.
inline std::span<const uint8_t> bytes_of(const msg::TrainPositionReport& report) {
  return std::span(report.message()).first(std::min<size_t>(report.message_bytes(), report.message().size()));
}

}  // namespace railfix::messaging
