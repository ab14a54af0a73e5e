// From the patches' displacements to the motion of the camera's foot, with the errors of the camera poses as unknowns.
//
// A pitch error e moves the ground in the top view by (X^2 + H^2)/H * e, a height error h by X/H * h, an error a of the
// vertical curvature by X^3/(2 H) * a, motion by the same amount everywhere. Over 8 m of ground these differ, so one
// least-squares problem holds step, turn and the pose errors of both pictures; what is known of the reference picture's
// errors is carried from step to step. This way the noise of the measured poses does not reach the distance, and their
// lasting pitch error (which would be a scale error) is found from the ground.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "odometry/texture_alignment.hpp"

namespace railfix::odometry {

/// How well a picture's camera pose is known: covariance of pitch (rad), height (m) and vertical curvature (1/m).
/// The rails tell the three together much better than each alone, so what is between them counts.
struct PoseTrust {
  Eigen::Matrix3d covariance = Eigen::Vector3d(1e-6, 2.5e-5, 1e-10).asDiagonal();

  static PoseTrust independent(double pitch_sigma_rad, double height_sigma_m, double vertical_sigma_per_m = 1e-6);
  [[nodiscard]] double pitch_sigma_rad() const;
};

/// Errors of one picture's pose and the distance there. Errors are pose used less true pose.
struct PoseErrors {
  enum Index { kDistance, kPitch, kHeight, kVertical, kPitchBias, kBallastDepth, kCount };
  using Mean = Eigen::Matrix<double, kCount, 1>;
  using Covariance = Eigen::Matrix<double, kCount, kCount>;
  Mean mean = Mean::Zero();  // distance relative to the reference picture's, m; rad; m; 1/m; rad; m
  Covariance covariance = Covariance::Zero();
};

struct Motion {
  double along_m = 0;           // of the camera's foot between the pictures
  double lateral_m = 0;         // left positive, beside the sheet's own curve
  double turn_rad = 0;          // left positive, beside the sheet's own curve
  double bends_more_per_m = 0;  // the new picture's sheet than the reference's, left positive
  double along_sigma_m = 0;
  double lateral_sigma_m = 0;
  double turn_sigma_rad = 0;
  double agreement = 0;                                   // sum of the patches' weights over their number, 0..1
  PoseErrors::Mean reference = PoseErrors::Mean::Zero();  // the reference picture's errors, seen from here
  PoseErrors now;                                         // distance relative to the reference picture's
};

/// What is known of a new picture's pose before its ground is compared: pose used less measured pose, and how far the
/// measured one may be off.
struct PosePrior {
  double pitch_offset_rad = 0;
  double height_offset_m = 0;
  double vertical_offset_per_m = 0;
  PoseTrust trust;
};

/// What two pictures share: the suspension moves the camera only so fast, and the track bends only so fast. Poses used,
/// new less reference, and how far their errors may differ. The sheets' curves (left positive) are what they are.
struct PoseTie {
  double height_used_m = 0;
  double vertical_used_per_m = 0;
  double curvature_used_per_m = 0;
  double height_sigma_m = 0.05;
  double vertical_sigma_per_m = 1e-3;
};

class MotionFilter {
 public:
  struct Options {
    double pitch_bias_sigma_rad = 0.0003;  // how far the measured pitch may be off for longer; 0 = never
    double pitch_bias_length_m = 200;      // of way, after which it is another
    double ballast_depth_m =
        0.02;  // of the ballast below the sleeper tops, and how far that may be off; 0 = not at all
    double ballast_depth_sigma_m = 0.03;
    double ballast_depth_walk_m_per_sqrt_m = 3e-4;
    double ballast_scatter_m = 0.03;  // of the depth from one bay between sleepers to the next
  };
  explicit MotionFilter(const Options& options) : options_(options) {}

  /// The first picture's errors, before anything is seen.
  [[nodiscard]] PoseErrors first(const PosePrior& prior) const;
  /// Least squares over the patches, each weighted down as it disagrees with the others (Cauchy). Keeps its buffers.
  void solve(const PoseErrors& reference, const PosePrior& prior, const PoseTie& tie, double height_m,
             const std::vector<PatchMotion>& patches, Motion& motion);
  /// Displacement of a place in the top view under this motion.
  [[nodiscard]] static Eigen::Vector2d displacement(const Motion& motion, double height_m,
                                                    const Eigen::Vector2d& place_m, bool ballast);

 private:
  static constexpr int kUnknowns = PoseErrors::kCount + 6;
  using Vector = Eigen::Matrix<double, kUnknowns, 1>;
  using Matrix = Eigen::Matrix<double, kUnknowns, kUnknowns>;
  struct Vote {  // of one patch: rows and displacement times the root of its information
    Vector rows[2];
    double values[2];
    double weight = 1;
    double error = 0;  // squared, in the patch's own sigmas
  };
  void set_prior(const PoseErrors& reference, const PosePrior& prior);
  void tie(int now, int reference, double used, double sigma);
  [[nodiscard]] Eigen::Matrix2d information_of(const PatchMotion& patch, double height_m) const;
  void set_votes(double height_m, double bends_more_per_m, const std::vector<PatchMotion>& patches);
  [[nodiscard]] Matrix information(double scale, Vector& right) const;
  double weigh(const Vector& solution);
  void walk(Motion& motion) const;

  Options options_;
  Matrix prior_information_ = Matrix::Zero();
  Vector prior_right_ = Vector::Zero();
  std::vector<Vote> votes_;
  std::vector<double> errors_;
};

}  // namespace railfix::odometry
