#include "track_detector/rail_fit.hpp"

#include <Eigen/Dense>
#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>

#include "core/median.hpp"
#include "estimation/robust_least_squares.hpp"

namespace railfix::track_detector {
namespace {

using Equations = estimation::NormalEquations<kShapeSize>;
using Matrix8 = Eigen::Matrix<double, kShapeSize, kShapeSize>;
using Row = Eigen::Matrix<double, 1, kShapeSize>;
using Jacobian = Eigen::Matrix<double, 2, kShapeSize>;

constexpr double kFarthestM = 1000.0;
constexpr double kNearestM = 0.3;
constexpr double kFixedByRails = 6;  // unknowns that two curved rails fix; the priors hold the rest

/// The rails seen by the camera, with derivatives. Uses 1/X along the rail: in it a straight rail's picture is linear.
class RailPicture {
 public:
  RailPicture(const geometry::Intrinsics& camera, const ShapeVector& shape)
      : fu_(camera.fu_px), fv_(camera.fv_px), p_(shape), twist_(twist_of(shape(7))) {
    const geometry::CameraPose pose{p_(0), p_(1), p_(2), p_(3), p_(4)};
    rotation_ = geometry::rotation_camera_from_track(pose);
    // d/dangle of R = B Rx' Ry' Rz' is a rotation about an axis that the later turns have moved.
    const Eigen::Matrix3d from_roll = Eigen::AngleAxisd(p_(0), Eigen::Vector3d::UnitX()).toRotationMatrix();
    const Eigen::Matrix3d from_pitch = Eigen::AngleAxisd(p_(1), Eigen::Vector3d::UnitY()).toRotationMatrix();
    const Eigen::Matrix3d from_yaw = Eigen::AngleAxisd(p_(2), Eigen::Vector3d::UnitZ()).toRotationMatrix();
    const Eigen::Vector3d roll_axis = from_yaw * from_pitch * from_roll * Eigen::Vector3d::UnitX();
    const Eigen::Vector3d pitch_axis = from_yaw * Eigen::Vector3d::UnitY();
    turn_ = {rotation_ * -skew(roll_axis), rotation_ * -skew(pitch_axis), rotation_ * -skew(Eigen::Vector3d::UnitZ())};
  }

  /// Pixel from the principal point and its derivative by 1/X; false behind the camera.
  bool at(double half_gauge_m, double inverse_m, Eigen::Vector2d& pixel, Eigen::Vector2d& along) {
    const double w = inverse_m;
    direction_ = {1.0, (half_gauge_m - p_(3)) * w + 0.5 * p_(5) / w + p_(7) / (6.0 * w * w),
                  0.5 * p_(6) / w - p_(4) * w + twist_.per_m * half_gauge_m};
    half_gauge_m_ = half_gauge_m;
    const Eigen::Vector3d by_w(0.0, (half_gauge_m - p_(3)) - 0.5 * p_(5) / (w * w) - p_(7) / (3.0 * w * w * w),
                               -0.5 * p_(6) / (w * w) - p_(4));
    seen_ = rotation_ * direction_;
    if (seen_.z() < 1e-3) return false;
    pixel = {fu_ * seen_.x() / seen_.z(), fv_ * seen_.y() / seen_.z()};
    along = in_picture(rotation_ * by_w);
    return true;
  }

  /// 1/X where a pixel's ray meets the plane of the rail heads.
  [[nodiscard]] double inverse_on_plane(const Eigen::Vector2d& pixel) const {
    const Eigen::Vector3d ray = rotation_.transpose() * Eigen::Vector3d(pixel.x() / fu_, pixel.y() / fv_, 1.0);
    return std::clamp(-ray.z() / (p_(4) * std::max(ray.x(), 1e-3)), 1.0 / kFarthestM, 1.0 / kNearestM);
  }

  /// Derivative of the last at()'s pixel by the unknowns, X held.
  Jacobian by_shape(double inverse_m) const {
    const double w = inverse_m;
    Jacobian j;
    for (int k = 0; k < 3; ++k) j.col(k) = in_picture(turn_[static_cast<size_t>(k)] * direction_);
    j.col(3) = in_picture(rotation_.col(1) * -w);
    j.col(4) = in_picture(rotation_.col(2) * -w);
    j.col(5) = in_picture(rotation_.col(1) * (0.5 / w));
    j.col(6) = in_picture(rotation_.col(2) * (0.5 / w));
    j.col(7) = in_picture(rotation_.col(1) / (6.0 * w * w) + rotation_.col(2) * (twist_.by_rate * half_gauge_m_));
    return j;
  }

 private:
  static Eigen::Matrix3d skew(const Eigen::Vector3d& v) {
    Eigen::Matrix3d m;
    m << 0, -v.z(), v.y(), v.z(), 0, -v.x(), -v.y(), v.x(), 0;
    return m;
  }
  [[nodiscard]] Eigen::Vector2d in_picture(const Eigen::Vector3d& change) const {
    const double x = seen_.x() / seen_.z();
    const double y = seen_.y() / seen_.z();
    return {fu_ * (change.x() - x * change.z()) / seen_.z(), fv_ * (change.y() - y * change.z()) / seen_.z()};
  }

  double fu_;
  double fv_;
  ShapeVector p_;
  Twist twist_;
  Eigen::Matrix3d rotation_;
  std::array<Eigen::Matrix3d, 3> turn_;
  Eigen::Vector3d direction_ = Eigen::Vector3d::Zero();
  double half_gauge_m_ = 0;  // of the last at()
  Eigen::Vector3d seen_ = Eigen::Vector3d::Zero();
};

/// Slides along the rail to the point of the curve that is nearest to the measured one; gives its 1/X.
bool slide_to_nearest(RailPicture& rails, const FitPoint& point, double& w, Eigen::Vector2d& pixel,
                      Eigen::Vector2d& along) {
  w = rails.inverse_on_plane(point.pixel);
  for (int i = 0; i < 20; ++i) {
    if (!rails.at(point.half_gauge_m, w, pixel, along)) return false;
    const double step = (point.pixel - pixel).dot(along) / along.squaredNorm();
    const double next = std::clamp(w + std::clamp(step, -0.5 * w, w), 1.0 / kFarthestM, 1.0 / kNearestM);
    if (std::abs(next - w) < 1e-13 * w) break;
    w = next;
  }
  return rails.at(point.half_gauge_m, w, pixel, along);
}

/// Where a Builder keeps what it works on.
struct FitBuffers {
  std::vector<FitPoint>& points;
  std::vector<double>& residuals_px;
  std::vector<double>& weights;
  std::vector<double>& ratios;
};

/// Adds all points; keeps their residuals (px) and weights.
class Builder {
 public:
  Builder(const geometry::Intrinsics& camera, const FitBuffers& buffers, const RailFitOptions& options)
      : camera_(camera),
        points_(buffers.points),
        residuals_px_(buffers.residuals_px),
        weights_(buffers.weights),
        ratios_(buffers.ratios),
        options_(options),
        prior_(to_vector(options.prior)),
        prior_sigma_(to_vector(options.prior_sigma)) {
    residuals_px_.assign(points_.size(), 0.0);
    weights_.assign(points_.size(), 0.0);
  }

  bool operator()(const ShapeVector& shape, Equations& equations, bool with_priors = true) {
    RailPicture rails(camera_, shape);
    by_offset.setZero();
    by_bias.setZero();
    for (size_t i = 0; i < points_.size(); ++i) {
      if (!add_point(rails, i, equations)) return false;
    }
    for (int k = 0; k < kShapeSize; ++k) {
      if (prior_sigma_(k) <= 0) {  // held: an infinitely strong prior would spoil the numbers
        equations.information.row(k).setZero();
        equations.information.col(k).setZero();
        equations.information(k, k) = 1;
        equations.gradient(k) = 0;
      } else if (with_priors && std::isfinite(prior_sigma_(k))) {
        equations.add_prior(k, shape(k) - prior_(k), prior_sigma_(k));
      }
    }
    return true;
  }

  /// The points' sigmas from their scatter: kSigmaOfMedian times the median residual, made good for the unknowns. They
  /// only become smaller: larger ones would let wild points in. Returns the factor that the scatter asks for.
  double scale_sigmas(double least) {
    if (points_.size() <= kShapeSize) return 1;
    ratios_.resize(points_.size());
    for (size_t i = 0; i < points_.size(); ++i) ratios_[i] = std::abs(residuals_px_[i]) / points_[i].sigma_px;
    const auto middle = ratios_.begin() + static_cast<std::ptrdiff_t>(ratios_.size() / 2);
    std::nth_element(ratios_.begin(), middle, ratios_.end());
    const auto count = static_cast<double>(points_.size());
    const double factor = std::max(least, core::kSigmaOfMedian * *middle * std::sqrt(count / (count - kFixedByRails)));
    for (auto& point : points_) point.sigma_px *= std::min(1.0, factor);
    return factor;
  }

  /// Sums of J'W times the derivative by a sideways offset of the left and of the right rail.
  Eigen::Matrix<double, kShapeSize, 2> by_offset = Eigen::Matrix<double, kShapeSize, 2>::Zero();
  /// The same by one sigma of the edges' common bias in pixels.
  Eigen::Matrix<double, kShapeSize, 2> by_bias = Eigen::Matrix<double, kShapeSize, 2>::Zero();

 private:
  bool add_point(RailPicture& rails, size_t i, Equations& equations) {
    const FitPoint& point = points_[i];
    double w = point.inverse_m;
    Eigen::Vector2d pixel;
    Eigen::Vector2d along;
    if (point.ahead_known) {
      if (!rails.at(point.half_gauge_m, w, pixel, along)) return false;
    } else if (!slide_to_nearest(rails, point, w, pixel, along)) {
      return false;
    }
    const Jacobian j = rails.by_shape(w);
    const Eigen::Vector2d normal = Eigen::Vector2d(-along.y(), along.x()).normalized();
    const Eigen::Vector2d difference = pixel - point.pixel;
    residuals_px_[i] = normal.dot(difference);
    const Row across = normal.transpose() * j / point.sigma_px;
    weights_[i] = equations.add(across, residuals_px_[i] / point.sigma_px, options_.cauchy_scale);
    const int rail = point.half_gauge_m > 0 ? 0 : 1;
    by_offset.col(rail) -= weights_[i] * across(3) * across.transpose();
    by_bias.col(rail) -= weights_[i] * point.bias_sigma_px * across(3) / j.col(3).norm() * across.transpose();
    if (point.ahead_known) {
      const Eigen::Vector2d tangent = along.normalized();
      const Row lengthwise = tangent.transpose() * j / point.sigma_px;
      equations.add(lengthwise, tangent.dot(difference) / point.sigma_px, options_.cauchy_scale);
    }
    return true;
  }

  const geometry::Intrinsics& camera_;
  std::vector<FitPoint>& points_;
  std::vector<double>& residuals_px_;
  std::vector<double>& weights_;
  std::vector<double>& ratios_;
  const RailFitOptions& options_;
  ShapeVector prior_;
  ShapeVector prior_sigma_;
};

double condition_of(const Eigen::Matrix<double, 7, 7>& information) {
  const Eigen::Matrix<double, 7, 1> scale = information.diagonal().cwiseMax(1e-300).cwiseSqrt().cwiseInverse();
  const Eigen::Matrix<double, 7, 7> scaled = scale.asDiagonal() * information * scale.asDiagonal();
  const Eigen::Matrix<double, 7, 1> values =
      Eigen::SelfAdjointEigenSolver<Eigen::Matrix<double, 7, 7>>(scaled, Eigen::EigenvaluesOnly).eigenvalues();
  if (values(0) <= values(6) * 1e-16) return std::numeric_limits<double>::infinity();
  return values(6) / values(0);
}

void summarise(const std::vector<double>& weights, RailFit& fit) {
  double squares = 0;
  size_t used = 0;
  for (size_t i = 0; i < weights.size(); ++i) {
    if (weights[i] <= 0.5) continue;
    squares += fit.residuals_px[i] * fit.residuals_px[i];
    ++used;
  }
  fit.residual_px = used > 0 ? std::sqrt(squares / static_cast<double>(used)) : 0.0;
  fit.inliers = weights.empty() ? 0.0 : static_cast<double>(used) / static_cast<double>(weights.size());
}

}  // namespace

ShapeVector to_vector(const TrackShape& s) {
  ShapeVector v;
  v << s.camera.roll_rad, s.camera.pitch_rad, s.camera.yaw_rad, s.camera.lateral_m, s.camera.height_m,
      s.curvature_per_m, s.vertical_curvature_per_m, s.curvature_rate_per_m2;
  return v;
}

TrackShape to_shape(const ShapeVector& v) {
  return {{v(0), v(1), v(2), v(3), v(4)}, v(5), v(6), v(7)};
}

ShapeVector to_vector(const TrackShapeSigma& s) {
  ShapeVector v;
  v << s.roll_rad, s.pitch_rad, s.yaw_rad, s.lateral_m, s.height_m, s.curvature_per_m, s.vertical_curvature_per_m,
      s.curvature_rate_per_m2;
  return v;
}

// In a left curve the right rail is the higher one.
Twist twist_of(double curvature_rate_per_m2) {
  constexpr double kCantPerCurvatureM = 40.0;
  constexpr double kHeadsApartM = 1.5;
  constexpr double kFastestRatePerM2 = 7e-5;  // from straight to 300 m within 48 m
  constexpr double kPerRateM = -kCantPerCurvatureM / kHeadsApartM;
  const double share = curvature_rate_per_m2 / kFastestRatePerM2;
  const double damped = 1 + share * share;
  return {kPerRateM * curvature_rate_per_m2 / damped, kPerRateM * (1 - share * share) / (damped * damped)};
}

Eigen::Vector3d rail_point(const TrackShape& shape, Side side, double gauge_m, double ahead_m, double outward_m) {
  const double beside_m = (side == Side::left ? 1 : -1) * (gauge_m / 2 + outward_m);
  const double x2 = ahead_m * ahead_m;
  return {ahead_m, beside_m + 0.5 * shape.curvature_per_m * x2 + shape.curvature_rate_per_m2 * x2 * ahead_m / 6.0,
          0.5 * shape.vertical_curvature_per_m * x2 + twist_of(shape.curvature_rate_per_m2).per_m * ahead_m * beside_m};
}

void RailFitter::prepare(const geometry::Intrinsics& camera, const std::vector<EdgePoint>& points, double gauge_m) {
  points_.clear();
  points_.reserve(points.size());
  for (const auto& point : points) {
    FitPoint p;
    const Eigen::Vector2d n = geometry::undistort(camera, point.pixel);
    p.pixel = {camera.fu_px * n.x(), camera.fv_px * n.y()};
    p.half_gauge_m = point.side == Side::left ? gauge_m / 2 : -gauge_m / 2;
    p.sigma_px = point.sigma_px;
    p.bias_sigma_px = point.bias_sigma_px;
    p.ahead_known = std::isfinite(point.ahead_m);
    if (p.ahead_known) p.inverse_m = 1.0 / point.ahead_m;
    points_.push_back(p);
  }
}

const RailFit& RailFitter::fit(const geometry::Intrinsics& camera, const std::vector<EdgePoint>& points,
                               const TrackShape& start, const RailFitOptions& options) {
  prepare(camera, points, options.gauge_m);
  Builder builder(camera, {points_, fit_.residuals_px, weights_, ratios_}, options);
  estimation::LeastSquaresOptions limits;
  limits.max_iterations = options.max_iterations;
  limits.step_tolerance = options.step_tolerance;
  auto solution = estimation::least_squares<kShapeSize>(builder, to_vector(start), limits);
  fit_.sigma_factor = 1;
  if (options.least_sigma_factor > 0) {
    fit_.sigma_factor = builder.scale_sigmas(options.least_sigma_factor);
    solution = estimation::least_squares<kShapeSize>(builder, solution.x, limits);
  }
  fit_.shape = to_shape(solution.x);
  fit_.converged = solution.converged;
  fit_.last_step = solution.last_step;
  Equations data;
  builder(solution.x, data, false);
  const double spread = std::max(1.0, fit_.sigma_factor * fit_.sigma_factor);
  const Matrix8 information = solution.equations.information - (1.0 - 1.0 / spread) * data.information;
  Matrix8 covariance = information.inverse();
  const Eigen::Matrix<double, kShapeSize, 2> moved =
      covariance * builder.by_offset * (options.rail_offset_sigma_m / spread);
  const Eigen::Matrix<double, kShapeSize, 2> shifted = covariance * builder.by_bias / spread;
  covariance += moved * moved.transpose() + shifted * shifted.transpose();
  fit_.covariance = covariance.topLeftCorner<7, 7>();
  fit_.condition = condition_of(data.information.topLeftCorner<7, 7>());
  summarise(weights_, fit_);
  return fit_;
}

}  // namespace railfix::track_detector
