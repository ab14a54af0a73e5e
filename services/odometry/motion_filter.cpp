#include "odometry/motion_filter.hpp"

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>

namespace railfix::odometry {
namespace {

// Unknowns: the reference's distance, pitch and height error, pitch bias, ballast depth, then the new picture's errors.
// In the order of PoseErrors first.
enum Unknown {
  kDistanceR,
  kPitchR,
  kHeightR,
  kBias,
  kBallast,
  kDistanceN,
  kPitchN,
  kHeightN,
  kLateral,
  kTurn,
  kUnknowns
};
using Vector = Eigen::Matrix<double, kUnknowns, 1>;
using Matrix = Eigen::Matrix<double, kUnknowns, kUnknowns>;
using Rows = Eigen::Matrix<double, 2, kUnknowns>;

constexpr double kLateralSigmaM = 0.05;
constexpr double kTurnSigmaRad = 0.02;
constexpr double kDistanceSigmaM = 1e3;
constexpr double kTinyVariance = 1e-12;
constexpr double kCauchySquared = 4.0;
constexpr double kMedianChiSquared2 = 1.386;  // two degrees of freedom
constexpr int kReweightings = 5;

// Displacement (ahead, left) of a place that shows at `place` in the reference and `now` in the new view, per unknown.
Rows rows_at(const Eigen::Vector2d& place, const Eigen::Vector2d& now, double height_m, bool ballast) {
  const double x = place.x();
  const double xn = now.x();
  const double n = place.y();
  Rows rows = Rows::Zero();
  rows(0, kDistanceR) = 1.0;
  rows(0, kDistanceN) = -1.0;
  rows(0, kPitchR) = (x * x + height_m * height_m) / height_m;
  rows(0, kPitchN) = -(xn * xn + height_m * height_m) / height_m;
  rows(0, kHeightR) = -x / height_m;
  rows(0, kHeightN) = xn / height_m;
  rows(0, kTurn) = n;
  if (ballast) rows(0, kBallast) = (x - xn) / height_m;  // farther away than the sheet, so it seems slower
  rows(1, kPitchR) = n * x / height_m;
  rows(1, kPitchN) = -n * xn / height_m;
  rows(1, kHeightR) = -n / height_m;
  rows(1, kHeightN) = n / height_m;
  rows(1, kLateral) = -1.0;
  rows(1, kTurn) = -xn;
  return rows;
}

void add_prior(Matrix& information, Vector& right, const Vector& row, double value, double sigma) {
  const double weight = 1.0 / (sigma * sigma);
  information += weight * row * row.transpose();
  right += weight * value * row;
}

}  // namespace

PoseErrors MotionFilter::first(const PosePrior& prior) const {
  PoseErrors errors;
  const double bias = options_.pitch_bias_sigma_rad * options_.pitch_bias_sigma_rad;
  errors.mean(PoseErrors::kBallastDepth) = options_.ballast_depth_m;
  errors.covariance(PoseErrors::kBallastDepth, PoseErrors::kBallastDepth) =
      options_.ballast_depth_sigma_m * options_.ballast_depth_sigma_m;
  errors.mean(PoseErrors::kPitch) = prior.pitch_offset_rad;
  errors.mean(PoseErrors::kHeight) = prior.height_offset_m;
  errors.covariance(PoseErrors::kPitch, PoseErrors::kPitch) =
      prior.trust.pitch_sigma_rad * prior.trust.pitch_sigma_rad + bias;
  errors.covariance(PoseErrors::kHeight, PoseErrors::kHeight) = prior.trust.height_sigma_m * prior.trust.height_sigma_m;
  errors.covariance(PoseErrors::kPitchBias, PoseErrors::kPitchBias) = bias;
  errors.covariance(PoseErrors::kPitch, PoseErrors::kPitchBias) = bias;
  errors.covariance(PoseErrors::kPitchBias, PoseErrors::kPitch) = bias;
  return errors;
}

Motion MotionFilter::solve(const PoseErrors& reference, const PosePrior& prior, double height_m,
                           const std::vector<PatchMotion>& patches) const {
  Matrix prior_information = Matrix::Zero();
  Vector prior_right = Vector::Zero();
  constexpr int kCarried = PoseErrors::kCount;
  const PoseErrors::Covariance covariance = reference.covariance + kTinyVariance * PoseErrors::Covariance::Identity();
  prior_information.topLeftCorner<kCarried, kCarried>() = covariance.inverse();
  prior_right.head<kCarried>() = prior_information.topLeftCorner<kCarried, kCarried>() * reference.mean;
  Vector row = Vector::Zero();
  row(kPitchN) = 1.0;
  row(kBias) = -1.0;
  add_prior(prior_information, prior_right, row, prior.pitch_offset_rad, prior.trust.pitch_sigma_rad);
  add_prior(prior_information, prior_right, Vector::Unit(kHeightN), prior.height_offset_m, prior.trust.height_sigma_m);
  add_prior(prior_information, prior_right, Vector::Unit(kLateral), 0.0, kLateralSigmaM);
  add_prior(prior_information, prior_right, Vector::Unit(kTurn), 0.0, kTurnSigmaRad);
  add_prior(prior_information, prior_right, Vector::Unit(kDistanceN), 0.0, kDistanceSigmaM);

  std::vector<Rows> rows;
  rows.reserve(patches.size());
  for (const PatchMotion& patch : patches)
    rows.push_back(rows_at(patch.place_m, patch.place_m + patch.displacement_m, height_m, patch.ballast));

  std::vector<double> weights(patches.size(), 1.0);
  std::vector<double> errors(patches.size(), 0.0);
  double scale = 1.0;  // of the patches' squared errors against their promise
  Vector solution = Vector::Zero();
  Eigen::LDLT<Matrix> solver;
  for (int iteration = 0; iteration <= kReweightings; ++iteration) {
    Matrix information = prior_information;
    Vector right = prior_right;
    for (size_t i = 0; i < patches.size(); ++i) {
      const Eigen::Matrix<double, kUnknowns, 2> weighted =
          rows[i].transpose() * patches[i].information * (weights[i] / scale);
      information += weighted * rows[i];
      right += weighted * patches[i].displacement_m;
    }
    solver.compute(information);
    solution = solver.solve(right);
    if (patches.empty() || iteration == kReweightings) break;
    for (size_t i = 0; i < patches.size(); ++i) {
      const Eigen::Vector2d left_over = patches[i].displacement_m - rows[i] * solution;
      errors[i] = left_over.dot(patches[i].information * left_over);
    }
    std::vector<double> sorted = errors;
    std::nth_element(sorted.begin(), sorted.begin() + static_cast<std::ptrdiff_t>(sorted.size() / 2), sorted.end());
    scale = std::max(1.0, sorted[sorted.size() / 2] / kMedianChiSquared2);
    for (size_t i = 0; i < patches.size(); ++i) weights[i] = 1.0 / (1.0 + errors[i] / (scale * kCauchySquared));
  }

  const Matrix all = solver.solve(Matrix::Identity());
  Motion motion;
  motion.along_m = solution(kDistanceN) - solution(kDistanceR);
  motion.lateral_m = solution(kLateral);
  motion.turn_rad = solution(kTurn);
  motion.along_sigma_m = std::sqrt(
      std::max(0.0, all(kDistanceN, kDistanceN) + all(kDistanceR, kDistanceR) - 2.0 * all(kDistanceN, kDistanceR)));
  motion.lateral_sigma_m = std::sqrt(std::max(0.0, all(kLateral, kLateral)));
  motion.turn_sigma_rad = std::sqrt(std::max(0.0, all(kTurn, kTurn)));
  motion.disagreement = std::sqrt(scale);
  for (const double weight : weights) motion.agreement += weight / static_cast<double>(weights.size());
  motion.reference_pitch_error_rad = solution(kPitchR);
  motion.reference_height_error_m = solution(kHeightR);
  constexpr int kOfNow[kCarried] = {kDistanceN, kPitchN, kHeightN, kBias, kBallast};
  for (int i = 0; i < kCarried; ++i) {
    motion.now.mean(i) = solution(kOfNow[i]);
    for (int j = 0; j < kCarried; ++j) motion.now.covariance(i, j) = all(kOfNow[i], kOfNow[j]);
  }
  const auto walk = [&motion](PoseErrors::Index index, double per_sqrt_m) {
    motion.now.covariance(index, index) += per_sqrt_m * per_sqrt_m * std::abs(motion.along_m);
  };
  if (options_.pitch_bias_sigma_rad > 0) walk(PoseErrors::kPitchBias, options_.pitch_bias_walk_rad_per_sqrt_m);
  if (options_.ballast_depth_sigma_m > 0) walk(PoseErrors::kBallastDepth, options_.ballast_depth_walk_m_per_sqrt_m);
  return motion;
}

Eigen::Vector2d MotionFilter::displacement(const Motion& motion, double height_m, const Eigen::Vector2d& place_m,
                                           bool ballast) {
  Vector unknowns = Vector::Zero();
  unknowns(kPitchR) = motion.reference_pitch_error_rad;
  unknowns(kHeightR) = motion.reference_height_error_m;
  unknowns(kBallast) = motion.now.mean(PoseErrors::kBallastDepth);
  unknowns(kDistanceN) = motion.along_m;
  unknowns(kPitchN) = motion.now.mean(PoseErrors::kPitch);
  unknowns(kHeightN) = motion.now.mean(PoseErrors::kHeight);
  unknowns(kLateral) = motion.lateral_m;
  unknowns(kTurn) = motion.turn_rad;
  const Eigen::Vector2d first =
      rows_at(place_m, place_m - Eigen::Vector2d(motion.along_m, 0), height_m, ballast) * unknowns;
  return rows_at(place_m, place_m + first, height_m, ballast) * unknowns;
}

}  // namespace railfix::odometry
