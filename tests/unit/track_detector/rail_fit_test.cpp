#include "track_detector/rail_fit.hpp"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <cmath>
#include <cstdio>
#include <limits>

#include "core/random.hpp"
#include "core/units.hpp"

namespace {

using railfix::core::rad_from_deg;
using railfix::core::Random;
using railfix::geometry::Intrinsics;
using railfix::geometry::View;
using namespace railfix::track_detector;

constexpr double kUnknown = std::numeric_limits<double>::infinity();

/// Exact edge points of both rails, evenly spaced along the track.
std::vector<EdgePoint> exact_points(const Intrinsics& camera, const TrackShape& shape, double gauge_m, double near_m,
                                    double far_m, int count, bool ahead_known, double sigma_px) {
  const View view(camera, shape.camera);
  std::vector<EdgePoint> points;
  for (const auto side : {Side::left, Side::right}) {
    for (int i = 0; i < count; ++i) {
      const double ahead_m = near_m + (far_m - near_m) * i / (count - 1);
      const auto pixel = view.project(rail_point(shape, side, gauge_m, ahead_m));
      EXPECT_TRUE(pixel.has_value());
      points.push_back({*pixel, side, sigma_px, ahead_known ? ahead_m : std::numeric_limits<double>::quiet_NaN()});
    }
  }
  return points;
}

/// Paper 000, 3.2: f = 1 m, H = 2.5 m, phi = pi/36, theta = pi/12, aimed between the rails at 9.3 m.
struct PaperCase {
  Intrinsics camera{1, 1, 0, 0, 0, 0, 0, 0, 0, 0};
  TrackShape mount;
  RailFitOptions options;
  PaperCase() {
    const double pi = railfix::core::kPi;
    mount.camera.pitch_rad = pi / 12;
    mount.camera.yaw_rad = pi / 36;
    mount.camera.lateral_m = -2.5 / std::tan(pi / 12) * std::sin(pi / 36);
    mount.camera.height_m = 2.5;
    options.gauge_m = 1.46;
    options.cauchy_scale = 0;
    options.prior = mount;
    options.prior_sigma = {kUnknown, kUnknown, kUnknown, kUnknown, kUnknown, kUnknown, kUnknown, 0};
    options.max_iterations = 100;
    options.step_tolerance = 1e-9;
  }
  /// The extreme case with the signs of `bits`.
  [[nodiscard]] TrackShape extreme(int bits) const {
    const auto sign = [bits](int bit) { return (bits >> bit & 1) != 0 ? 1.0 : -1.0; };
    TrackShape shape = mount;
    shape.camera.roll_rad += sign(0) * rad_from_deg(3.6);
    shape.camera.pitch_rad += sign(1) * rad_from_deg(3.6);
    shape.camera.yaw_rad += sign(2) * rad_from_deg(3.6);
    shape.camera.lateral_m += sign(3) * 0.014;
    shape.camera.height_m += sign(4) * 0.014;
    shape.curvature_per_m = sign(5) * 0.03;
    shape.vertical_curvature_per_m = sign(6) * 0.01;
    return shape;
  }
};

TEST(RailFit, ReproducesThePapersExtremeCaseWithKnownPoints) {
  const PaperCase paper;
  for (int bits = 0; bits < 128; ++bits) {
    const TrackShape truth = paper.extreme(bits);
    const auto fit = fit_rails(paper.camera, exact_points(paper.camera, truth, 1.46, 5, 15, 21, true, 1e-3),
                               paper.mount, paper.options);
    EXPECT_TRUE(fit.converged) << bits;
    EXPECT_LT(std::abs(fit.shape.curvature_per_m - truth.curvature_per_m), 1e-11) << bits;
    EXPECT_LT(std::abs(fit.shape.vertical_curvature_per_m - truth.vertical_curvature_per_m), 1e-11) << bits;
    EXPECT_LT((to_vector(fit.shape) - to_vector(truth)).cwiseAbs().maxCoeff(), 1e-9) << bits;
  }
}

TEST(RailFit, ReproducesThePapersExtremeCaseWithoutKnowingWhereAlongTheRailAPointIs) {
  const PaperCase paper;
  for (int bits = 0; bits < 128; ++bits) {
    const TrackShape truth = paper.extreme(bits);
    const auto points = exact_points(paper.camera, truth, 1.46, 5, 15, 21, false, 1e-3);
    // The limits of the shake lead into the right valley; then they are taken off, so that the points alone decide.
    RailFitOptions limited = paper.options;
    limited.prior_sigma = {rad_from_deg(3.6), rad_from_deg(3.6), rad_from_deg(3.6), 0.014, 0.014, 0.03, 0.01, 0};
    const auto near = fit_rails(paper.camera, points, paper.mount, limited);
    const auto fit = fit_rails(paper.camera, points, near.shape, paper.options);
    EXPECT_LT(std::abs(fit.shape.curvature_per_m - truth.curvature_per_m), 1e-9) << bits;
    EXPECT_LT(std::abs(fit.shape.vertical_curvature_per_m - truth.vertical_curvature_per_m), 1e-9) << bits;
  }
}

/// Errors of many draws against the Cramer-Rao bound of each.
struct AgainstBound {
  double errors = 0;
  double squares = 0;
  double bounds = 0;
  int draws = 0;
  void add(double error, double variance) {
    errors += error;
    squares += error * error;
    bounds += variance;
    ++draws;
  }
  [[nodiscard]] double ratio() const { return std::sqrt(squares / bounds); }
  [[nodiscard]] double bias_in_standard_errors() const { return errors / std::sqrt(bounds); }
  void expect_reached(const char* name) const {
    std::printf("%s: %d draws, rms error %.3g, %.3f x the Cramer-Rao bound, bias %.2f standard errors\n", name, draws,
                std::sqrt(squares / draws), ratio(), bias_in_standard_errors());
    EXPECT_LT(ratio(), 1.1) << name;
    EXPECT_LT(std::abs(bias_in_standard_errors()), 3.0) << name;
  }
};

// Half a pixel of noise on both coordinates, a focal length of 1200 pixels; nothing is known but the gauge.
TEST(RailFit, ReachesTheCramerRaoBoundInThePapersExtremeCase) {
  PaperCase paper;
  constexpr double kNoise = 0.5 / 1200;
  AgainstBound alpha;
  AgainstBound beta;
  Random random(23);
  for (int draw = 0; draw < 1000; ++draw) {
    const TrackShape truth = paper.extreme(draw % 128);
    auto points = exact_points(paper.camera, truth, 1.46, 5, 15, 21, true, kNoise);
    const auto exact = fit_rails(paper.camera, points, truth, paper.options);
    for (auto& point : points) point.pixel += kNoise * Eigen::Vector2d(random.normal(), random.normal());
    const auto fit = fit_rails(paper.camera, points, paper.mount, paper.options);
    ASSERT_TRUE(fit.converged) << draw;
    alpha.add(fit.shape.vertical_curvature_per_m - truth.vertical_curvature_per_m, exact.covariance(6, 6));
    beta.add(fit.shape.curvature_per_m - truth.curvature_per_m, exact.covariance(5, 5));
  }
  alpha.expect_reached("alpha");
  beta.expect_reached("beta");
}

const Intrinsics kDistortedCab{1200, 1200, 639.5, 511.5, -0.05, 0.01, 1e-4, -2e-4, 1280, 1024};

struct CabCase {
  TrackShape mount;
  RailFitOptions options;
  CabCase() {
    mount.camera = {0, rad_from_deg(6), 0, 0.1, 2.5};
    options.prior = mount;
    options.prior_sigma = {rad_from_deg(0.5), rad_from_deg(0.5), rad_from_deg(1), 0.05, 0.03, 0.01, 0.001, 0};
    options.cauchy_scale = 0;
  }
};

// Every draw takes a new truth from the priors and new noise: then the covariance is the (Bayesian) Cramer-Rao bound.
TEST(RailFit, ReachesTheCramerRaoBoundWithNoise) {
  const CabCase cab;
  Random random(7);
  Eigen::Matrix<double, 7, 1> error_squares = Eigen::Matrix<double, 7, 1>::Zero();
  Eigen::Matrix<double, 7, 1> bound_squares = Eigen::Matrix<double, 7, 1>::Zero();
  double normalised = 0;
  constexpr int kDraws = 1000;
  const ShapeVector sigma = to_vector(cab.options.prior_sigma);
  for (int draw = 0; draw < kDraws; ++draw) {
    ShapeVector truth = to_vector(cab.mount);
    for (int k = 0; k < 7; ++k) truth(k) += sigma(k) * (k == 5 ? 0.3 : 1.0) * random.normal();
    if (std::abs(truth(5)) > 0.005) truth(5) = 0.005;
    auto points = exact_points(kDistortedCab, to_shape(truth), 1.435, 7, 40, 40, false, 0.5);
    for (auto& point : points) point.pixel += 0.5 * Eigen::Vector2d(random.normal(), random.normal());
    const auto fit = fit_rails(kDistortedCab, points, cab.mount, cab.options);
    ASSERT_TRUE(fit.converged) << draw;
    const Eigen::Matrix<double, 7, 1> error = (to_vector(fit.shape) - truth).head<7>();
    error_squares += error.cwiseAbs2();
    bound_squares += fit.covariance.diagonal();
    normalised += error.dot(fit.covariance.ldlt().solve(error));
  }
  for (int k = 0; k < 7; ++k) EXPECT_LT(std::sqrt(error_squares(k) / bound_squares(k)), 1.1) << "unknown " << k;
  EXPECT_NEAR(normalised / kDraws, 7.0, 0.6);
}

TEST(RailFit, OneFifthOfWildPointsDoesNotPullTheFit) {
  CabCase cab;
  cab.options.cauchy_scale = 2;
  TrackShape truth = cab.mount;
  truth.camera.pitch_rad += rad_from_deg(0.4);
  truth.curvature_per_m = 1.0 / 400;
  auto points = exact_points(kDistortedCab, truth, 1.435, 7, 40, 40, false, 0.5);
  Random random(3);
  for (size_t i = 0; i < points.size(); ++i) {
    points[i].pixel.x() += i % 5 == 0 ? 12.0 : 0.3 * random.normal();
  }
  const auto fit = fit_rails(kDistortedCab, points, cab.mount, cab.options);
  EXPECT_NEAR(fit.shape.curvature_per_m, truth.curvature_per_m, 1e-4);
  EXPECT_NEAR(fit.inliers, 0.8, 0.05);
}

TEST(RailFit, StraightRailsFixFourNumbersAndTheConditionSaysSo) {
  const CabCase cab;
  const auto straight = fit_rails(kDistortedCab, exact_points(kDistortedCab, cab.mount, 1.435, 7, 40, 40, false, 0.5),
                                  cab.mount, cab.options);
  EXPECT_GT(straight.condition, 1e6);
  // What the rails do not fix keeps its prior: lateral and roll trade off, the height is fixed by the gauge.
  EXPECT_GT(std::sqrt(straight.covariance(0, 0)), 0.7 * cab.options.prior_sigma.roll_rad);
  EXPECT_LT(std::sqrt(straight.covariance(4, 4)), 0.5 * cab.options.prior_sigma.height_m);
  const auto known = fit_rails(kDistortedCab, exact_points(kDistortedCab, cab.mount, 1.435, 7, 40, 40, true, 0.5),
                               cab.mount, cab.options);
  EXPECT_LT(known.condition, straight.condition);
}

TEST(RailFit, OneRailAloneKeepsTheRestAtThePrior) {
  const CabCase cab;
  auto points = exact_points(kDistortedCab, cab.mount, 1.435, 7, 40, 40, false, 0.5);
  points.resize(40);
  const auto fit = fit_rails(kDistortedCab, points, cab.mount, cab.options);
  EXPECT_TRUE(fit.converged);
  EXPECT_NEAR(std::sqrt(fit.covariance(4, 4)), cab.options.prior_sigma.height_m, 0.005);
}

// The points are said to be five times worse than they are: the residuals tell, and the errors keep to the covariance.
TEST(RailFit, TakesTheSigmasFromTheResiduals) {
  CabCase cab;
  cab.options.cauchy_scale = 2;
  cab.options.least_sigma_factor = 0.05;
  Random random(11);
  double squares = 0;
  constexpr int kDraws = 200;
  for (int draw = 0; draw < kDraws; ++draw) {
    auto points = exact_points(kDistortedCab, cab.mount, 1.435, 7, 40, 40, false, 0.5);
    for (auto& point : points) point.pixel += 0.1 * Eigen::Vector2d(random.normal(), random.normal());
    const auto fit = fit_rails(kDistortedCab, points, cab.mount, cab.options);
    EXPECT_NEAR(fit.sigma_factor, 0.2, 0.1);
    squares += std::pow(fit.shape.camera.height_m - 2.5, 2) / fit.covariance(4, 4);
  }
  EXPECT_NEAR(std::sqrt(squares / kDraws), 1.0, 0.25);
}

TEST(RailFit, AnOffsetOfAWholeRailWidensTheHeight) {
  CabCase cab;
  const auto points = exact_points(kDistortedCab, cab.mount, 1.435, 7, 40, 40, false, 0.05);
  const auto exact = fit_rails(kDistortedCab, points, cab.mount, cab.options);
  cab.options.rail_offset_sigma_m = 0.002;
  const auto worn = fit_rails(kDistortedCab, points, cab.mount, cab.options);
  const double expected_m = 2.5 * std::sqrt(2.0) * 0.002 / 1.435;
  EXPECT_NEAR(std::sqrt(worn.covariance(4, 4) - exact.covariance(4, 4)), expected_m, 0.2 * expected_m);
}

/// What is fitted to rails whose curvature grows from `curvature_per_m` at `rate_per_m2`, and that twist beside it.
TrackShape fit_of_twisted_rails(TrackShape shape, double twist_per_m, double rate_sigma_per_m2) {
  const Intrinsics camera{755, 755, 319.5, 255.5, 0, 0, 0, 0, 640, 512};
  const View view(camera, shape.camera);
  std::vector<EdgePoint> points;
  for (const double side : {1.0, -1.0}) {
    for (double x = 5; x < 17; x *= 1.03) {
      const double beside_m = side * 1.435 / 2;
      const double y = beside_m + shape.curvature_per_m * x * x / 2 + shape.curvature_rate_per_m2 * x * x * x / 6;
      points.push_back({*view.project({x, y, twist_per_m * x * beside_m}), side > 0 ? Side::left : Side::right, 0.35});
    }
  }
  RailFitOptions options;
  options.prior.camera = shape.camera;
  options.prior_sigma = {0.008, 0.008, 0.02, 0.10, 0.04, 0.003, 0.0005, rate_sigma_per_m2};
  options.least_sigma_factor = 0.15;
  return fit_rails(camera, points, options.prior, options).shape;
}

// The end of a left curve: the right rail, which was the higher one, comes down.
TEST(RailFit, ACantRampIsNoVerticalCurve) {
  TrackShape shape;
  shape.camera = {0, rad_from_deg(8), 0, 0, 2.6};
  shape.curvature_per_m = 0.0025;
  shape.curvature_rate_per_m2 = -1.0 / 300 / 90;
  constexpr double kCantM = 0.13;  // at a radius of 300 m, gone after 90 m
  const auto fit = fit_of_twisted_rails(shape, kCantM / 90 / 1.5, 3e-5);
  EXPECT_LT(std::abs(fit.vertical_curvature_per_m), 1.5e-5);
  EXPECT_LT(std::abs(fit.camera.pitch_rad - shape.camera.pitch_rad), 2e-4);
}

// Its curvature comes within metres, and there is no ramp.
TEST(RailFit, ASwitchIsNotTakenForACantRamp) {
  TrackShape shape;
  shape.camera = {0, rad_from_deg(8), 0, 0, 2.6};
  shape.curvature_rate_per_m2 = 1.0 / 190 / 15;
  const auto fit = fit_of_twisted_rails(shape, 0, 1e-3);
  EXPECT_LT(std::abs(fit.camera.roll_rad), 2e-3);
  EXPECT_LT(std::abs(fit.camera.pitch_rad - shape.camera.pitch_rad), 5e-4);
}

TEST(RailFit, NoPointsGiveThePriorBack) {
  const CabCase cab;
  const auto fit = fit_rails(kDistortedCab, {}, cab.mount, cab.options);
  EXPECT_NEAR(fit.shape.camera.height_m, 2.5, 1e-9);
  EXPECT_EQ(fit.inliers, 0);
}

}  // namespace
