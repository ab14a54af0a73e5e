// Where the camera sits and looks, from pictures of straight track: the vanishing point gives pitch and yaw, the known
// gauge gives the height, the two slopes the sideways position.
#pragma once

#include <opencv2/core.hpp>
#include <vector>

#include "core/result.hpp"
#include "track_detector/track_detector.hpp"

namespace railfix::track_detector {

struct MountCalibration {
  geometry::CameraPose mount;  // roll as given: straight rails cannot tell it from a sideways position
  geometry::CameraPose sigma;  // one sigma; roll: 0, as its own is not known here
  size_t pictures = 0;
  size_t seen = 0;      // pictures with both rails found
  size_t straight = 0;  // of those, used
  double residual_px = 0;
};

/// Add pictures, then solve. Works from a rough idea of the mount or none.
class MountCalibrator {
 public:
  /// `roll_rad` from elsewhere (gravity), 0 where nothing is known. `lens_sigma`: of the camera's numbers, zeros where
  /// they are not known.
  MountCalibrator(const geometry::Intrinsics& camera, double gauge_m, double roll_rad = 0,
                  const geometry::Intrinsics& lens_sigma = {});

  /// Grey pictures of the camera's size, any distance apart. All are kept until solve().
  void add(const cv::Mat& grey) { pictures_.push_back(grey); }
  /// An error when fewer than three pictures show straight track, or fewer than half the rails of this mount: what was
  /// given of the camera is wrong then.
  [[nodiscard]] core::Result<MountCalibration> solve() const;

 private:
  [[nodiscard]] std::vector<TrackObservation> look(const geometry::CameraPose& start, const TrackShapeSigma& limits,
                                                   size_t max_pictures) const;
  [[nodiscard]] core::Result<geometry::CameraPose> rough() const;
  void add_lens(MountCalibration& result) const;
  void add_sigmas(const std::vector<TrackObservation>& seen, const geometry::CameraPose& spread,
                  MountCalibration& result) const;
  [[nodiscard]] static core::Status check_enough(const MountCalibration& result);
  /// The candidate that most pictures agree with.
  [[nodiscard]] geometry::CameraPose elected(const std::vector<geometry::CameraPose>& candidates) const;

  geometry::Intrinsics camera_;
  double gauge_m_;
  double roll_rad_;
  geometry::Intrinsics lens_sigma_;
  std::vector<cv::Mat> pictures_;
};

/// The own rails in one picture of a camera whose mount nobody knows: every usual height, pitch, yaw and sideways
/// position is tried (about a second). Roll is held at 0.
TrackObservation find_rails_anywhere(const geometry::Intrinsics& camera, const cv::Mat& grey, double gauge_m);

}  // namespace railfix::track_detector
