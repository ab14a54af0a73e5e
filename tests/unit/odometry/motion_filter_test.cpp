#include "odometry/motion_filter.hpp"

#include <gtest/gtest.h>

#include <cmath>

namespace railfix::odometry {
namespace {

constexpr double kHeightM = 2.7;
constexpr double kStepM = 0.5;

/// What a camera that goes half a metre sees of this ground: how far a place (ahead, left of the foot, in metres of the
/// top view) moves.
template <class Displacement>
Motion motion_over(const Displacement& displacement_m, const PoseTie& tie) {
  std::vector<PatchMotion> patches;
  for (double ahead_m = 4; ahead_m <= 12; ahead_m += 0.8) {
    for (double left_m = -0.6; left_m <= 0.6; left_m += 0.2) {
      const Eigen::Vector2d place(ahead_m, left_m);
      const Eigen::Matrix2d information = Eigen::Vector2d(1e6, 1e6).asDiagonal();
      patches.push_back({place, displacement_m(place), information, false, 1});
    }
  }
  MotionFilter filter({});
  PosePrior prior;
  prior.trust = PoseTrust::independent(1e-4, 1e-3);
  Motion motion;
  filter.solve(filter.first(prior), prior, tie, kHeightM, patches, motion);
  return motion;
}

// Ground that is nearer to the camera seems further from its foot.
TEST(MotionFilter, TheTwistOfTheTrackIsNoTurn) {
  const double roll_per_m = 0.133 / 1.5 / 60;  // full cant of a curve of 300 m within 60 m
  const auto nearer = [&](const Eigen::Vector2d& place) { return roll_per_m * place.x() * place.y() / kHeightM; };
  const auto motion = motion_over(
      [&](const Eigen::Vector2d& place) -> Eigen::Vector2d {
        const Eigen::Vector2d ground = place * (1 - nearer(place)) - Eigen::Vector2d(kStepM, 0);
        return ground * (1 + nearer(ground)) - place;
      },
      {});
  const double turn_ahead_rad = 1.0 / 300 / 60 * kStepM;  // how much more the track turns one metre ahead of the foot
  EXPECT_NEAR(motion.turn_rad, 0, 0.3 * turn_ahead_rad);
  EXPECT_NEAR(motion.along_m, kStepM, 1e-3);
}

TEST(MotionFilter, ASheetThatBendsMoreThanTheOtherIsNoTurn) {
  PoseTie tie;
  tie.curvature_used_per_m = 3e-4;
  const auto shown = [&](const Eigen::Vector2d& place) {
    const double ahead_m = place.x() - kStepM;
    return Eigen::Vector2d(-kStepM, -0.5 * tie.curvature_used_per_m * ahead_m * ahead_m);
  };
  const auto motion = motion_over(shown, tie);
  EXPECT_NEAR(motion.turn_rad, 0, 1e-6);
  EXPECT_NEAR(motion.lateral_m, 0, 1e-6);
  const Eigen::Vector2d place(8, 0.4);
  EXPECT_NEAR((MotionFilter::displacement(motion, kHeightM, place, false) - shown(place)).norm(), 0, 1e-4);
}

}  // namespace
}  // namespace railfix::odometry
