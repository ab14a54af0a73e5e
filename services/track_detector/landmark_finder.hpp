// Balises in the track: found in every picture, followed over pictures, each reported once.
//
// A balise is a plate between the rails that differs from what lies before, behind and on both sides of it, even in
// itself, with edges where a plate of its size has them. Sleepers fail on their sides, stones on evenness, stains on
// their edges. What moves evenly towards the train over several pictures is reported.
#pragma once

#include <cstdint>
#include <memory>
#include <opencv2/core.hpp>
#include <vector>

#include "vision/ground_sheet.hpp"

namespace railfix::track_detector {

struct LandmarkOptions {
  double balise_length_m = 0.36;  // along the track
  double balise_width_m = 0.48;
  double balise_depth_m = 0.12;        // its top below the rail heads
  double balise_depth_sigma_m = 0.02;  // scatter from place to place
  double reference_m = 8.0;            // distance ahead at which it is reported
  double far_m = 14.0;
  double half_width_m = 0.58;
  double lowest_contrast = 0.10;  // of the plate against each of its four sides, share of the brightness
  double max_speed_mps = 70;
  int fewest_pictures = 4;
  double lowest_confidence = 0.88;  // below it nothing is reported: a false sighting is worse than a missed one
};

struct LandmarkPicture {
  cv::Mat grey;  // CV_8UC1
  int64_t stamp_ns = 0;
  geometry::CameraPose pose;
  double pitch_sigma_rad = 0.0005;
  double curvature_per_m = 0;
  double vertical_curvature_per_m = 0;
  uint64_t frame_seq = 0;
  int64_t grabbed_ns = 0;
};

enum class LandmarkType : uint8_t { balise };

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

/// A plate in one picture.
struct PlateCandidate {
  double ahead_m = 0;
  double lateral_m = 0;
  double contrast = 0;  // weakest of its four sides, share of the brightness
};

class LandmarkFinder {
 public:
  LandmarkFinder(const geometry::Intrinsics& camera, const LandmarkOptions& options);

  /// Pictures in the order of their stamps, with the pose of this picture. Gives what is settled now.
  std::vector<Sighting> process(const LandmarkPicture& picture);

 private:
  struct Spot {
    int64_t stamp_ns;
    double ahead_m;
    double lateral_m;
    double contrast;
  };
  struct Track {
    std::vector<Spot> spots;
    bool reported = false;
    int missed = 0;  // pictures since it was last seen
    int gaps = 0;    // pictures that did not show it, in all
  };
  void follow(const std::vector<PlateCandidate>& found, int64_t stamp_ns);
  [[nodiscard]] Track* owner_of(const PlateCandidate& candidate, int64_t stamp_ns);
  [[nodiscard]] bool settle(const Track& track, const LandmarkPicture& picture, Sighting& sighting) const;

  geometry::Intrinsics camera_;
  LandmarkOptions options_;
  std::unique_ptr<vision::TopViewMaker> maker_;
  vision::TopView view_;
  std::vector<Track> tracks_;
};

}  // namespace railfix::track_detector
