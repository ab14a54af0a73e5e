// Upright things beside and over the track: masts, platforms, bridges, tunnels. Painted over the ground from far to
// near.
#pragma once

#include <opencv2/core.hpp>

#include "simulator/ground_shader.hpp"
#include "simulator/local_track.hpp"

namespace railfix::simulator {

/// Paints into `radiance` (CV_32FC1).
void draw_scenery(const Line& line, const LocalTrack& main, const GroundShader& shader,
                  const geometry::Intrinsics& camera, const Shot& shot, cv::Mat& radiance);

}  // namespace railfix::simulator
