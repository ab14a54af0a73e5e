// Upright things beside and over the track: masts, platforms, bridges, tunnels. Painted over the ground from far to
// near.
#pragma once

#include <opencv2/core.hpp>

#include "simulator/illumination.hpp"
#include "simulator/local_track.hpp"
#include "simulator/renderer.hpp"

namespace railfix::simulator {

/// Paints into `radiance` (CV_32FC1).
void draw_scenery(const Line& line, const LocalTrack& main, const Illumination& light,
                  const geometry::Intrinsics& camera, const Shot& shot, cv::Mat& radiance);

}  // namespace railfix::simulator
