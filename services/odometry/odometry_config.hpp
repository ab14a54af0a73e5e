// Section `odometry` of the configuration.
#pragma once

#include <string>

#include "odometry/train_mouse.hpp"
#include "service/config.hpp"

namespace railfix::odometry {

struct OdometryConfig {
  std::string camera = "cam0";
  double max_wait_ms = 25;
  TrainMouseOptions mouse;

  void describe(service::Fields& fields) {
    fields.text("camera", camera, "The camera whose pictures are measured: camera_frame/<camera>.");
    fields.number("max_wait_ms", max_wait_ms, {0, 1000}, "ms",
                  "How long a picture waits for its own track_view before the last pose is taken.");
    fields.number("gauge_m", mouse.gauge_m, {0.5, 2.0}, "m", "Track gauge; the ground between the rails is used.");
    fields.number("texture_depth_m", mouse.texture_depth_m, {0, 0.5}, "m",
                  "Sleeper tops below the rail heads. 1 cm wrong is 0.4 % of distance.");
    fields.number("rail_margin_m", mouse.rail_margin_m, {0, 0.4}, "m", "Ground beside each rail that is not used.");
    fields.number("near_m", mouse.near_m, {1, 30}, "m", "Nearest ground used, ahead of the camera.");
    fields.number("far_m", mouse.far_m, {4, 60}, "m", "Farthest ground used.");
    fields.number("cell_m", mouse.cell_m, {0.005, 0.1}, "m", "Cell of the top view.");
    fields.number("noise_grey", mouse.noise_grey, {0.1, 50}, "grey levels",
                  "Weaker gradients of the top view are noise.");
    fields.number("max_speed_mps", mouse.max_speed_mps, {1, 150}, "m/s", "Fastest motion looked for after a gap.");
    fields.number("max_acceleration_mps2", mouse.max_acceleration_mps2, {0.1, 10}, "m/s^2", "Widens the search band.");
    fields.number("search_band_m", mouse.search_band_m, {0.05, 2}, "m",
                  "Half width of the search around the prediction.");
    fields.number("reference_length_m", mouse.reference_length_m, {0.05, 3}, "m",
                  "The reference picture stays until the train has moved so far.");
    fields.number("lowest_score", mouse.lowest_score, {0.05, 0.95}, "",
                  "Correlation below which the ground is not found.");
    fields.number("ambiguity", mouse.ambiguity, {0.1, 1}, "",
                  "After a gap, the second-best match must stay below this share of the best.");
    fields.number("lowest_contrast_grey", mouse.lowest_contrast_grey, {0.1, 50}, "grey levels",
                  "Texture below it is none: the odometry is blind.");
    fields.number("mount_pitch_sigma_rad", mouse.mount_pitch_sigma_rad, {1e-5, 0.1}, "rad",
                  "Shake of the pitch while the rails are not seen.");
    fields.number("mount_height_sigma_m", mouse.mount_height_sigma_m, {1e-4, 0.2}, "m",
                  "Shake of the height while the rails are not seen.");
    fields.number("pitch_bias_sigma_rad", mouse.filter.pitch_bias_sigma_rad, {0, 0.02}, "rad",
                  "How far measured pitch may lastingly be off; the ground corrects it. 0: trust it.");
    fields.number("pitch_bias_length_m", mouse.filter.pitch_bias_length_m, {1, 1e6}, "m",
                  "Way after which that error is another one.");
    fields.number("ballast_depth_m", mouse.filter.ballast_depth_m, {-0.1, 0.3}, "m",
                  "Ballast below the sleeper tops, to begin with.");
    fields.number("ballast_depth_sigma_m", mouse.filter.ballast_depth_sigma_m, {0, 0.2}, "m",
                  "How far that may be off; the ground corrects it. 0: trust it.");
    fields.number("ballast_depth_walk_m_per_sqrt_m", mouse.filter.ballast_depth_walk_m_per_sqrt_m, {0, 0.01},
                  "m/sqrt(m)", "How fast it may change along the line.");
    fields.number("ballast_scatter_m", mouse.filter.ballast_scatter_m, {0, 0.2}, "m",
                  "How much it differs from one bay between sleepers to the next, 1 sigma.");
    fields.number("standstill_m", mouse.standstill_m, {0, 0.05}, "m",
                  "At standstill, motion is counted when it exceeds this length.");
    fields.number("bridge_s", mouse.bridge_s, {0, 30}, "s",
                  "The cumulative distance goes on with the mean speed over gaps up to this long.");
  }
};

}  // namespace railfix::odometry
