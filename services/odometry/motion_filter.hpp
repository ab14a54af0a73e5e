// From the patches' displacements to the motion of the camera's foot, with the errors of the camera poses as unknowns.
//
// A pitch error e moves the ground in the top view by (X^2 + H^2)/H * e, a height error h by X/H * h, motion by the
// same amount everywhere. Over 8 m of ground the three differ, so one least-squares problem holds step, turn and the
// pose errors of both pictures; what is known of the reference picture's errors is carried from step to step. This way
// the noise of the measured poses does not reach the distance, and their lasting pitch error (which would be a scale
// error) is found from the ground: a wrong pitch makes far ground seem to move faster than near ground.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "odometry/texture_alignment.hpp"

namespace railfix::odometry {

/// How well a picture's camera pose is known, 1 sigma.
struct PoseTrust {
  double pitch_sigma_rad = 0.001;
  double height_sigma_m = 0.005;
};

/// Errors of one picture's pose and the distance there. Errors are pose used less true pose.
struct PoseErrors {
  enum Index { kDistance, kPitch, kHeight, kPitchBias, kBallastDepth, kCount };
  using Mean = Eigen::Matrix<double, kCount, 1>;
  using Covariance = Eigen::Matrix<double, kCount, kCount>;
  Mean mean = Mean::Zero();  // distance relative to the reference picture's, m; pitch rad; height m; rad; m
  Covariance covariance = Covariance::Zero();
};

struct Motion {
  double along_m = 0;    // of the camera's foot between the pictures
  double lateral_m = 0;  // left positive, beside the sheet's own curve
  double turn_rad = 0;   // left positive, beside the sheet's own curve
  double along_sigma_m = 0;
  double lateral_sigma_m = 0;
  double turn_sigma_rad = 0;
  double agreement = 0;     // sum of the patches' weights over their number, 0..1
  double disagreement = 1;  // root of the normalised squared errors: 1 = patches differ as their gradients promise
  double reference_pitch_error_rad = 0;  // the reference picture's errors, seen from here
  double reference_height_error_m = 0;
  PoseErrors now;  // distance relative to the reference picture's
};

/// What is known of a new picture's pose before its ground is compared.
struct PosePrior {
  double pitch_offset_rad = 0;  // pose used less measured pose
  double height_offset_m = 0;
  PoseTrust trust;
};

class MotionFilter {
 public:
  struct Options {
    double pitch_bias_sigma_rad = 0.001;  // how far the measured pitch may lastingly be off; 0 = never
    double pitch_bias_walk_rad_per_sqrt_m = 2e-6;
    double ballast_depth_m =
        0.02;  // of the ballast below the sleeper tops, and how far that may be off; 0 = not at all
    double ballast_depth_sigma_m = 0.03;
    double ballast_depth_walk_m_per_sqrt_m = 3e-4;
  };
  explicit MotionFilter(const Options& options) : options_(options) {}

  /// The first picture's errors, before anything is seen.
  [[nodiscard]] PoseErrors first(const PosePrior& prior) const;
  /// Least squares over the patches, each weighted down as it disagrees with the others (Cauchy).
  [[nodiscard]] Motion solve(const PoseErrors& reference, const PosePrior& prior, double height_m,
                             const std::vector<PatchMotion>& patches) const;
  /// Displacement of a place in the top view under this motion.
  [[nodiscard]] static Eigen::Vector2d displacement(const Motion& motion, double height_m,
                                                    const Eigen::Vector2d& place_m, bool ballast);

 private:
  Options options_;
};

}  // namespace railfix::odometry
