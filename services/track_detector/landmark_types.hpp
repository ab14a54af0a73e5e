// What the searches for landmarks take and give, and what is reported of a landmark.
#pragma once

#include <cstdint>
#include <opencv2/core.hpp>

#include "geometry/camera.hpp"

namespace railfix::track_detector {

struct LandmarkOptions {
  double balise_length_m = 0.36;  // along the track
  double balise_width_m = 0.48;
  double balise_depth_m = 0.12;        // its top below the rail heads
  double balise_depth_sigma_m = 0.02;  // scatter from place to place
  double reference_m = 8.0;            // distance ahead at which what lies in the track is reported
  double far_m = 14.0;
  double half_width_m = 0.58;
  double lowest_contrast = 0.10;  // of the plate against each of its four sides, share of the brightness
  double max_speed_mps = 70;
  int fewest_pictures = 4;
  double lowest_confidence = 0.88;  // below it nothing is reported: a false sighting is worse than a missed one
  double gauge_m = 1.435;
  double texture_depth_m = 0.19;        // of sleepers and ballast below the rail heads, for the way between pictures
  double texture_depth_sigma_m = 0.06;  // crossing panels and snow lie higher, for all of a mast's looks alike
  double way_sigma = 0.01;              // of that way, share of it
  bool frogs = true;
  bool platforms = true;
  bool uprights = true;  // masts, portals, bridges
};

struct LandmarkPicture {
  cv::Mat grey;  // CV_8UC1
  int64_t stamp_ns = 0;
  geometry::CameraPose pose;
  double pitch_sigma_rad = 0.0005;
  double sigma_factor = 1;  // by the picture's health, of every sighting; the pitch's sigma is without it
  double curvature_per_m = 0;
  double vertical_curvature_per_m = 0;
  uint64_t frame_seq = 0;
  int64_t grabbed_ns = 0;
};

/// Numbers as SIGHTING_* of idl/track.idl.
enum class LandmarkType : uint8_t { frog = 1, balise, portal_in, portal_out, mast, bridge, platform };

/// As landmark_sighting (idl/track.idl).
struct Sighting {
  LandmarkType type = LandmarkType::balise;
  int64_t stamp_ns = 0;  // when it was distance_ahead_m in front of the camera's foot
  double distance_ahead_m = 0;
  double lateral_m = 0;
  double sigma_m = 0;
  double confidence = 0;
  uint64_t frame_seq = 0;  // of the picture that settled it
  int64_t grabbed_ns = 0;
};

/// Something in the ground plane in one picture: a plate, a frog.
struct GroundCandidate {
  double ahead_m = 0;
  double lateral_m = 0;
  double score = 0;            // plate: log of a likelihood ratio (PlateEvidence); frog: share of its rails seen
  double reference_m = 0;      // ahead, where it is settled; 0: where the tracker settles the others
  double lasting_sigma_m = 0;  // what errs alike in all looks
};

}  // namespace railfix::track_detector
