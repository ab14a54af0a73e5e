// Section `track_detector` of the configuration.
#pragma once

#include <string>

#include "service/config.hpp"
#include "track_detector/imu_roll.hpp"
#include "track_detector/landmark_finder.hpp"
#include "track_detector/track_detector.hpp"

namespace railfix::track_detector {

struct TrackDetectorConfig {
  std::string camera = "cam0";
  DetectorOptions detector;
  LandmarkOptions landmarks;
  ImuRollOptions imu_roll;

  void describe(service::Fields& fields) {
    fields.text("camera", camera, "The camera whose pictures are searched: camera_frame/<camera>.");
    fields.number("gauge_m", detector.gauge_m, {0.5, 2.0}, "m",
                  "Track gauge, between the inner edges of the rail heads.");
    fields.number("head_m", detector.head_m, {0.03, 0.12}, "m", "Width of a rail head.");
    fields.number("far_m", detector.far_m, {15, 200}, "m", "Rails are followed as far as this.");
    fields.number(
        "rail_offset_sigma_m", detector.rail_offset_sigma_m, {0, 0.02}, "m",
        "What gauge and wear move the edges of a whole rail, one sigma: no picture shows it, so it is added to "
        "the sigmas.");
    fields.number("min_contrast", detector.min_contrast, {1, 100}, "grey levels",
                  "A rail head stands out by at least this against the ground on both its sides.");
    fields.number("min_supported", detector.min_supported, {0.2, 1}, "",
                  "A rail is seen when it shows at this share of the places where it should.");
    fields.group("balises", "Plates between the rails that are reported as landmark_sighting.",
                 [this](service::Fields& group) { describe_balises(group); });
    fields.group("sightings", "What else is reported as landmark_sighting.",
                 [this](service::Fields& group) { describe_sightings(group); });
    fields.group("limits", "What suspension and curves do to the camera, one sigma about the mount.",
                 [this](service::Fields& group) { describe_limits(group); });
    fields.group("imu_roll",
                 "The gyro of an IMU in the body (imu_sample) narrows the roll. Without an IMU nothing changes.",
                 [this](service::Fields& group) { describe_imu_roll(group); });
  }

 private:
  void describe_balises(service::Fields& fields) {
    fields.number("length_m", landmarks.balise_length_m, {0.1, 1}, "m", "Size along the track.");
    fields.number("width_m", landmarks.balise_width_m, {0.1, 1}, "m", "Size across the track.");
    fields.number("depth_m", landmarks.balise_depth_m, {-0.1, 0.3}, "m", "Top of the plate below the rail heads.");
    fields.number("depth_sigma_m", landmarks.balise_depth_sigma_m, {0, 0.2}, "m", "Scatter of it from place to place.");
    fields.number("reference_m", landmarks.reference_m, {5, 12}, "m", "Distance ahead at which a balise is reported.");
    fields.number("lowest_contrast", landmarks.lowest_contrast, {0.02, 0.9}, "",
                  "Of the plate against each of its sides, share of the brightness.");
    fields.number("lowest_confidence", landmarks.lowest_confidence, {0, 1}, "", "Below it nothing is reported.");
  }
  void describe_sightings(service::Fields& fields) {
    fields.flag("frogs", landmarks.frogs, "Frogs of switches.");
    fields.flag("platforms", landmarks.platforms, "Beginnings and ends of platform edges.");
    fields.flag("uprights", landmarks.uprights, "Masts, tunnel portals and bridges.");
    fields.number("texture_depth_m", landmarks.texture_depth_m, {0, 0.5}, "m",
                  "Sleepers and ballast below the rail heads: scale of the way between pictures.");
    fields.number("texture_depth_sigma_m", landmarks.texture_depth_sigma_m, {0, 0.3}, "m",
                  "Scatter of it from place to place: masts to platforms are as wrong as the way past them.");
    fields.number("way_sigma", landmarks.way_sigma, {0.001, 0.1}, "", "Error of that way, share of it.");
  }
  void describe_imu_roll(service::Fields& fields) {
    fields.flag("use", imu_roll.use, "Use imu_sample where there is one.");
    fields.number("sway_hz", imu_roll.sway_hz, {0.2, 5}, "Hz", "Rolling of the body on its springs.");
    fields.number("slow_rad", imu_roll.slow_rad, {0, 0.1}, "rad",
                  "Roll that no gyro tells (load, wind, unbalanced cant), one sigma; a part of limits.roll_rad.");
    fields.number("twist_rps", imu_roll.twist_rps, {1e-4, 0.2}, "rad/s",
                  "Turning of the track under the train in cant ramps, and bias of the gyro, one sigma.");
    fields.number("noise_rps", imu_roll.noise_rps, {1e-5, 0.1}, "rad/s", "Noise of a gyro sample, one sigma.");
  }
  void describe_limits(service::Fields& fields) {
    auto& limits = detector.limits;
    fields.number("roll_rad", limits.roll_rad, {1e-4, 0.2}, "rad",
                  "Rolling. Straight rails do not fix it: keep it true.");
    fields.number("pitch_rad", limits.pitch_rad, {1e-4, 0.2}, "rad", "Pitching.");
    fields.number("yaw_rad", limits.yaw_rad, {1e-4, 0.2}, "rad",
                  "Yawing, with the turn of the cab against a curved track.");
    fields.number("lateral_m", limits.lateral_m, {1e-3, 1}, "m", "Sideways motion, with the overhang in curves.");
    fields.number("height_m", limits.height_m, {1e-3, 1}, "m", "Bounce and load.");
    fields.number("curvature_per_m", limits.curvature_per_m, {1e-4, 0.1}, "1/m", "Curvature of the track.");
    fields.number("vertical_curvature_per_m", limits.vertical_curvature_per_m, {1e-5, 0.02}, "1/m",
                  "Vertical curvature.");
    fields.number("curvature_rate_per_m2", limits.curvature_rate_per_m2, {1e-7, 1e-2}, "1/m^2",
                  "Change of the curvature in transition curves.");
  }
};

}  // namespace railfix::track_detector
