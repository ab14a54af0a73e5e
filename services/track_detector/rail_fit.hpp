// Camera shake and track shape from both rails of one picture (paper 000, 2.8-2.10 and 3.2), as full nonlinear robust
// least squares instead of the paper's single linearisation (3.8).
#pragma once

#include <Eigen/Core>
#include <limits>
#include <vector>

#include "geometry/camera.hpp"

namespace railfix::track_detector {

enum class Side { left, right };

/// Camera against the track, and the rails Y = +-gauge/2 + beta X^2/2 + rate X^3/6, Z = alpha X^2/2 +- twist X gauge/2
/// in track axes at the camera's foot. The twist is that of a cant ramp and follows the rate.
struct TrackShape {
  geometry::CameraPose camera;
  double curvature_per_m = 0;           // beta, left positive
  double vertical_curvature_per_m = 0;  // alpha, hollow positive
  double curvature_rate_per_m2 = 0;     // of a transition curve; a nuisance that keeps beta right where it changes
};
/// One sigma of each; also the Gaussian priors of the fit (0 = held fixed, infinity = unknown).
struct TrackShapeSigma {
  double roll_rad = 0;
  double pitch_rad = 0;
  double yaw_rad = 0;
  double lateral_m = 0;
  double height_m = 0;
  double curvature_per_m = 0;
  double vertical_curvature_per_m = 0;
  double curvature_rate_per_m2 = 0;
};
constexpr int kShapeSize = 8;  // roll, pitch, yaw, lateral, height, curvature, vertical curvature, curvature rate
using ShapeVector = Eigen::Matrix<double, kShapeSize, 1>;
ShapeVector to_vector(const TrackShape& shape);
TrackShape to_shape(const ShapeVector& vector);
ShapeVector to_vector(const TrackShapeSigma& sigma);

/// How the cant ramp of a transition curve twists the track, and how that changes with the curvature's rate.
struct Twist {
  double per_m = 0;    // rad/m, positive where the left rail rises
  double by_rate = 0;  // rad m
};
/// Where the curvature changes so does the cant, and in the curve a rail that goes up and one that goes down look like
/// a vertical curvature, of up to 1e-4 per metre. 40 m of cant per curvature are right for trains of 60 km/h that lean
/// nowhere; faster lines have more. What bends faster than a transition curve does is a switch, which has no cant.
Twist twist_of(double curvature_rate_per_m2);

/// Inner edge of a rail head at X, in track axes.
Eigen::Vector3d rail_point(const TrackShape& shape, Side side, double gauge_m, double ahead_m, double outward_m = 0);

/// A measured point of a rail's inner edge.
struct EdgePoint {
  Eigen::Vector2d pixel = Eigen::Vector2d::Zero();
  Side side = Side::left;
  double sigma_px = 0.5;
  /// Known X: then both pixel coordinates count (the paper's point-to-point distance, 3.5). NaN: the point may lie
  /// anywhere along the rail and only its distance along the picture normal of the rail counts.
  double ahead_m = std::numeric_limits<double>::quiet_NaN();
  /// One sigma of what moves all edges of this rail across by so many pixels alike; no residual shows it.
  double bias_sigma_px = 0;
};

struct RailFitOptions {
  double gauge_m = 1.435;
  double cauchy_scale = 2.0;  // in sigmas; 0 = plain squares
  /// Suspension limits about the calibrated mount: two straight rails fix only four numbers (paper 000, 3.1).
  TrackShape prior;
  TrackShapeSigma prior_sigma;
  /// Takes the points' sigmas times one factor from the residuals' scatter, but not below this: a covariance that the
  /// picture itself vouches for. 0 = the sigmas as they are.
  double least_sigma_factor = 0;
  /// Of what moves all edges of one rail sideways alike (gauge, wear, light on one side of the heads): no residual
  /// shows it, so it is added to the covariance.
  double rail_offset_sigma_m = 0;
  int max_iterations = 30;
  double step_tolerance = 1e-3;  // of the last step, in sigmas of the solution
};

struct RailFit {
  TrackShape shape;
  Eigen::Matrix<double, 7, 7> covariance;  // roll ... vertical curvature, the curvature rate marginalised
  double condition = 0;     // of the 7x7 information without priors, scaled to unit diagonal; infinity = singular
  double sigma_factor = 1;  // of the points' sigmas, as their scatter asks for
  double residual_px = 0;   // root mean square of the points with weight above one half
  double inliers = 0;       // fraction of points with weight above one half
  std::vector<double> residuals_px;  // per point, along the normal
  bool converged = false;
  double last_step = 0;  // in sigmas of the solution; robust weights may let it creep on below any tolerance
};

/// A measured point without distortion, in pixels from the principal point.
struct FitPoint {
  Eigen::Vector2d pixel;
  double half_gauge_m = 0;  // signed
  double sigma_px = 1;
  double bias_sigma_px = 0;
  double inverse_m = 0;  // where it is known
  bool ahead_known = false;
};

/// Keeps its buffers between fits.
class RailFitter {
 public:
  /// Fits from `start`. Points on one rail alone are allowed: the priors carry the rest and the covariance says so.
  /// Valid until the next call.
  const RailFit& fit(const geometry::Intrinsics& camera, const std::vector<EdgePoint>& points, const TrackShape& start,
                     const RailFitOptions& options);

 private:
  void prepare(const geometry::Intrinsics& camera, const std::vector<EdgePoint>& points, double gauge_m);

  std::vector<FitPoint> points_;
  std::vector<double> weights_, ratios_;
  RailFit fit_;
};

/// A single fit.
inline RailFit fit_rails(const geometry::Intrinsics& camera, const std::vector<EdgePoint>& points,
                         const TrackShape& start, const RailFitOptions& options) {
  return RailFitter().fit(camera, points, start, options);
}

}  // namespace railfix::track_detector
