#include "odometry/motion_filter.hpp"

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>

namespace railfix::odometry {
namespace {

// Unknowns: the reference's errors in the order of PoseErrors, then the new picture's.
enum Unknown {
  kDistanceR,
  kPitchR,
  kHeightR,
  kVerticalR,
  kBias,
  kBallast,
  kDistanceN,
  kPitchN,
  kHeightN,
  kVerticalN,
  kLateral,
  kTurn,
  kAll
};
constexpr int kOfNow[PoseErrors::kCount] = {kDistanceN, kPitchN, kHeightN, kVerticalN, kBias, kBallast};
using Vector = Eigen::Matrix<double, kAll, 1>;
using Rows = Eigen::Matrix<double, 2, kAll>;

constexpr double kLateralSigmaM = 0.05;
constexpr double kTurnSigmaRad = 0.02;
constexpr double kDistanceSigmaM = 1e3;
constexpr double kTinyVariance = 1e-12;
constexpr double kTinyVerticalVariance = 1e-16;
constexpr double kCauchySquared = 4.0;
constexpr double kMedianChiSquared2 = 1.386;  // two degrees of freedom
constexpr int kReweightings = 4;

// Displacement (ahead, left) of a place that shows at `place` in the reference and `now` in the new view, per unknown.
// A turn moves the ground on the left ahead of that on the right, too; where a transition curve twists the track that
// moves it by many times as much, so only the sideways motion tells the turn.
Rows rows_at(const Eigen::Vector2d& place, const Eigen::Vector2d& now, double height_m, bool ballast) {
  const double x = place.x();
  const double xn = now.x();
  const double n = place.y();
  const double per_m = 1.0 / height_m;
  Rows rows = Rows::Zero();
  rows(0, kDistanceR) = 1.0;
  rows(0, kDistanceN) = -1.0;
  rows(0, kPitchR) = (x * x + height_m * height_m) * per_m;
  rows(0, kPitchN) = -(xn * xn + height_m * height_m) * per_m;
  rows(0, kHeightR) = -x * per_m;
  rows(0, kHeightN) = xn * per_m;
  rows(0, kVerticalR) = 0.5 * x * x * x * per_m;
  rows(0, kVerticalN) = -0.5 * xn * xn * xn * per_m;
  if (ballast) rows(0, kBallast) = (x - xn) * per_m;  // farther away than the sheet, so it seems slower
  rows(1, kPitchR) = n * x * per_m;
  rows(1, kPitchN) = -n * xn * per_m;
  rows(1, kHeightR) = -n * per_m;
  rows(1, kHeightN) = n * per_m;
  rows(1, kVerticalR) = 0.5 * n * x * x * per_m;
  rows(1, kVerticalN) = -0.5 * n * xn * xn * per_m;
  rows(1, kLateral) = -1.0;
  rows(1, kTurn) = -xn;
  return rows;
}

// A sheet that bends more to the left shows the same ground further to the right.
double left_by_bend_m(double now_ahead_m, double bends_more_per_m) {
  return -0.5 * bends_more_per_m * now_ahead_m * now_ahead_m;
}

}  // namespace

PoseTrust PoseTrust::independent(double pitch_sigma_rad, double height_sigma_m, double vertical_sigma_per_m) {
  PoseTrust trust;
  const Eigen::Vector3d sigma(pitch_sigma_rad, height_sigma_m, vertical_sigma_per_m);
  trust.covariance = sigma.cwiseProduct(sigma).asDiagonal();
  return trust;
}

double PoseTrust::pitch_sigma_rad() const {
  return std::sqrt(covariance(0, 0));
}

PoseErrors MotionFilter::first(const PosePrior& prior) const {
  PoseErrors errors;
  const double bias = options_.pitch_bias_sigma_rad * options_.pitch_bias_sigma_rad;
  errors.mean(PoseErrors::kBallastDepth) = options_.ballast_depth_m;
  errors.covariance(PoseErrors::kBallastDepth, PoseErrors::kBallastDepth) =
      options_.ballast_depth_sigma_m * options_.ballast_depth_sigma_m;
  errors.mean(PoseErrors::kPitch) = prior.pitch_offset_rad;
  errors.mean(PoseErrors::kHeight) = prior.height_offset_m;
  errors.mean(PoseErrors::kVertical) = prior.vertical_offset_per_m;
  errors.covariance.block<3, 3>(PoseErrors::kPitch, PoseErrors::kPitch) = prior.trust.covariance;
  errors.covariance(PoseErrors::kPitch, PoseErrors::kPitch) += bias;
  errors.covariance(PoseErrors::kPitchBias, PoseErrors::kPitchBias) = bias;
  errors.covariance(PoseErrors::kPitch, PoseErrors::kPitchBias) = bias;
  errors.covariance(PoseErrors::kPitchBias, PoseErrors::kPitch) = bias;
  return errors;
}

void MotionFilter::set_prior(const PoseErrors& reference, const PosePrior& prior) {
  constexpr int kCarried = PoseErrors::kCount;
  PoseErrors::Mean tiny = PoseErrors::Mean::Constant(kTinyVariance);
  tiny(PoseErrors::kVertical) = kTinyVerticalVariance;
  PoseErrors::Covariance covariance = reference.covariance;
  covariance.diagonal() += tiny;
  prior_information_.setZero();
  prior_right_.setZero();
  prior_information_.topLeftCorner<kCarried, kCarried>() = covariance.inverse();
  prior_right_.head<kCarried>().noalias() =
      prior_information_.topLeftCorner<kCarried, kCarried>().lazyProduct(reference.mean);

  // The new picture's pitch less the lasting bias, its height and its vertical curvature are as measured.
  Eigen::Matrix<double, 3, kUnknowns> rows = Eigen::Matrix<double, 3, kUnknowns>::Zero();
  rows(0, kPitchN) = 1.0;
  rows(0, kBias) = -1.0;
  rows(1, kHeightN) = 1.0;
  rows(2, kVerticalN) = 1.0;
  const Eigen::Vector3d offset(prior.pitch_offset_rad, prior.height_offset_m, prior.vertical_offset_per_m);
  Eigen::Matrix3d trust = prior.trust.covariance;
  trust.diagonal() += Eigen::Vector3d(kTinyVariance, kTinyVariance, kTinyVerticalVariance);
  const Eigen::Matrix<double, kUnknowns, 3> weighted = rows.transpose().lazyProduct(trust.inverse());
  prior_information_ += weighted.lazyProduct(rows);
  prior_right_ += weighted.lazyProduct(offset);
  prior_information_(kLateral, kLateral) += 1.0 / (kLateralSigmaM * kLateralSigmaM);
  prior_information_(kTurn, kTurn) += 1.0 / (kTurnSigmaRad * kTurnSigmaRad);
  prior_information_(kDistanceN, kDistanceN) += 1.0 / (kDistanceSigmaM * kDistanceSigmaM);
}

// The errors (used less true) of two pictures differ by what was used, give or take sigma.
void MotionFilter::tie(int now, int reference, double used, double sigma) {
  const double weight = 1.0 / (sigma * sigma);
  prior_information_(now, now) += weight;
  prior_information_(reference, reference) += weight;
  prior_information_(now, reference) -= weight;
  prior_information_(reference, now) -= weight;
  prior_right_(now) += weight * used;
  prior_right_(reference) -= weight * used;
}

// The stones of one bay lie deeper than those of the next: a patch of ballast knows its motion only so well.
Eigen::Matrix2d MotionFilter::information_of(const PatchMotion& patch, double height_m) const {
  if (!patch.ballast) return patch.information;
  const double sigma_m = patch.displacement_m.x() / height_m * options_.ballast_scatter_m;
  const Eigen::Vector2d along = patch.information.col(0);
  const double variance = sigma_m * sigma_m;
  return patch.information - along * along.transpose() * (variance / (1.0 + variance * along.x()));
}

void MotionFilter::set_votes(double height_m, double bends_more_per_m, const std::vector<PatchMotion>& patches) {
  votes_.resize(patches.size());
  for (size_t i = 0; i < patches.size(); ++i) {
    const PatchMotion& patch = patches[i];
    const Eigen::Vector2d now = patch.place_m + patch.displacement_m;
    const Rows rows = rows_at(patch.place_m, now, height_m, patch.ballast);
    const double left_m = patch.displacement_m.y() - left_by_bend_m(now.x(), bends_more_per_m);
    const Eigen::Matrix2d known = information_of(patch, height_m);
    // Root of the information: its Cholesky factor, transposed.
    const double l00 = std::sqrt(known(0, 0));
    const double l10 = known(1, 0) / l00;
    const double l11 = std::sqrt(std::max(0.0, known(1, 1) - l10 * l10));
    Vote& vote = votes_[i];
    vote.rows[0] = l00 * rows.row(0).transpose() + l10 * rows.row(1).transpose();
    vote.rows[1] = l11 * rows.row(1).transpose();
    vote.values[0] = l00 * patch.displacement_m.x() + l10 * left_m;
    vote.values[1] = l11 * left_m;
    vote.weight = 1.0;
  }
}

MotionFilter::Matrix MotionFilter::information(double scale, Vector& right) const {
  Matrix sum = prior_information_;
  right = prior_right_;
  for (const Vote& vote : votes_) {
    const double weight = vote.weight / scale;
    for (int k = 0; k < 2; ++k) {
      const Vector weighted = weight * vote.rows[k];
      for (int j = 0; j < kUnknowns; ++j) sum.col(j) += vote.rows[k](j) * weighted;
      right += vote.values[k] * weighted;
    }
  }
  return sum;
}

// Weights the votes by their errors; returns how much larger the squared errors are than promised.
double MotionFilter::weigh(const Vector& solution) {
  errors_.clear();
  for (Vote& vote : votes_) {
    const double a = vote.values[0] - vote.rows[0].dot(solution);
    const double b = vote.values[1] - vote.rows[1].dot(solution);
    vote.error = a * a + b * b;
    errors_.push_back(vote.error);
  }
  const auto middle = errors_.begin() + static_cast<std::ptrdiff_t>(errors_.size() / 2);
  std::nth_element(errors_.begin(), middle, errors_.end());
  const double scale = std::max(1.0, *middle / kMedianChiSquared2);
  for (Vote& vote : votes_) vote.weight = 1.0 / (1.0 + vote.error / (scale * kCauchySquared));
  return scale;
}

void MotionFilter::solve(const PoseErrors& reference, const PosePrior& prior, const PoseTie& pose_tie, double height_m,
                         const std::vector<PatchMotion>& patches, Motion& motion) {
  static_assert(kUnknowns == kAll);
  set_prior(reference, prior);
  tie(kHeightN, kHeightR, pose_tie.height_used_m, pose_tie.height_sigma_m);
  tie(kVerticalN, kVerticalR, pose_tie.vertical_used_per_m, pose_tie.vertical_sigma_per_m);
  set_votes(height_m, pose_tie.curvature_used_per_m, patches);
  double scale = 1.0;
  Vector right;
  Eigen::LDLT<Matrix> solver(information(scale, right));
  Vector solution = solver.solve(right);
  for (int i = 0; i < kReweightings && !patches.empty(); ++i) {
    scale = weigh(solution);
    solver.compute(information(scale, right));
    solution = solver.solve(right);
  }
  const Matrix all = solver.solve(Matrix::Identity());
  const auto sigma = [&all](int i) { return std::sqrt(std::max(0.0, all(i, i))); };
  motion.along_m = solution(kDistanceN) - solution(kDistanceR);
  motion.lateral_m = solution(kLateral);
  motion.turn_rad = solution(kTurn);
  motion.bends_more_per_m = pose_tie.curvature_used_per_m;
  motion.along_sigma_m = std::sqrt(
      std::max(0.0, all(kDistanceN, kDistanceN) + all(kDistanceR, kDistanceR) - 2.0 * all(kDistanceN, kDistanceR)));
  motion.lateral_sigma_m = sigma(kLateral);
  motion.turn_sigma_rad = sigma(kTurn);
  motion.agreement = 0;
  for (const Vote& vote : votes_) motion.agreement += vote.weight / static_cast<double>(votes_.size());
  motion.reference = solution.head<PoseErrors::kCount>();
  for (int i = 0; i < PoseErrors::kCount; ++i) {
    motion.now.mean(i) = solution(kOfNow[i]);
    for (int j = 0; j < PoseErrors::kCount; ++j) motion.now.covariance(i, j) = all(kOfNow[i], kOfNow[j]);
  }
  walk(motion);
}

// The bias forgets itself over its length, the ballast's depth wanders.
void MotionFilter::walk(Motion& motion) const {
  auto& now = motion.now;
  const double way_m = std::abs(motion.along_m);
  constexpr auto kB = PoseErrors::kPitchBias;
  const double sigma = options_.pitch_bias_sigma_rad;
  const double keep = sigma > 0 ? std::exp(-way_m / options_.pitch_bias_length_m) : 1.0;
  now.mean(kB) *= keep;
  now.covariance.row(kB) *= keep;
  now.covariance.col(kB) *= keep;
  now.covariance(kB, kB) += (1.0 - keep * keep) * sigma * sigma;
  if (options_.ballast_depth_sigma_m > 0) {
    now.covariance(PoseErrors::kBallastDepth, PoseErrors::kBallastDepth) +=
        options_.ballast_depth_walk_m_per_sqrt_m * options_.ballast_depth_walk_m_per_sqrt_m * way_m;
  }
}

Eigen::Vector2d MotionFilter::displacement(const Motion& motion, double height_m, const Eigen::Vector2d& place_m,
                                           bool ballast) {
  Vector unknowns = Vector::Zero();
  unknowns.head<PoseErrors::kCount>() = motion.reference;
  for (int i = 0; i < PoseErrors::kCount; ++i) unknowns(kOfNow[i]) = motion.now.mean(i);
  unknowns(kDistanceR) = 0;
  unknowns(kDistanceN) = motion.along_m;
  unknowns(kLateral) = motion.lateral_m;
  unknowns(kTurn) = motion.turn_rad;
  const auto moved_m = [&](const Eigen::Vector2d& now_m) -> Eigen::Vector2d {
    return rows_at(place_m, now_m, height_m, ballast).lazyProduct(unknowns) +
           Eigen::Vector2d(0, left_by_bend_m(now_m.x(), motion.bends_more_per_m));
  };
  return moved_m(place_m + moved_m(place_m - Eigen::Vector2d(motion.along_m, 0)));
}

}  // namespace railfix::odometry
