// Upright things beside and over the track, and their shadows. Painted over the ground from far to near.
#pragma once

#include "simulator/stage.hpp"

namespace railfix::simulator {

/// Tunnels, bridges and platforms.
void add_buildings(Stage& stage);
/// Masts with wires, signals, boards and cabinets.
void add_furniture(Stage& stage);

/// Trains on the tracks beside the path.
void add_trains(Stage& stage, const std::vector<OtherTrain>& trains, double time_s);

/// Paints into `radiance` (CV_32FC1).
void draw_scenery(const Line& line, const LocalTrack& main, const Illumination& light, const RenderOptions& options,
                  const Shot& shot, cv::Mat& radiance);

}  // namespace railfix::simulator
