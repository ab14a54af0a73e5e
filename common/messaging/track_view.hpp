// Where in a track_view's covariance what stands.
#pragma once

#include <cstddef>

namespace railfix::messaging {

/// Of curvature_per_m, in the upper triangle, row by row.
inline constexpr size_t kCurvatureVariance = 25;

}  // namespace railfix::messaging
