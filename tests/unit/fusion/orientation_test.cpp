#include "fusion/orientation.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "core/random.hpp"
#include "core/units.hpp"

namespace railfix::fusion {
namespace {

constexpr double kDegree = 3.14159265358979 / 180;
constexpr double kDtS = 0.01;

struct Ride {
  double speed_mps = 14;
  double radius_m = 350;
  double roll_rad = 0;  // of the body, left side up
  double grade_rad = 0;
};

// Half a minute straight on, two minutes of curve, with noise and a gyro bias as of a cheap IMU.
Orientation after(const Ride& ride, bool corrected) {
  Orientation orientation;
  core::Random random(7);
  for (double t = 0; t < 150; t += kDtS) {
    const bool curve = t > 30;
    const double curvature = curve ? 1 / ride.radius_m : 0;
    const double roll = curve ? ride.roll_rad : 0;
    const ExpectedMotion motion{ride.speed_mps, 0, curvature, 0};
    // Seen from the body: up is turned by the roll to the left and by the grade to the front.
    const Eigen::Vector3d up(std::sin(ride.grade_rad), std::sin(roll), std::cos(roll) * std::cos(ride.grade_rad));
    const double turn = ride.speed_mps * curvature;
    Eigen::Vector3d force = core::kGravityMps2 * up.normalized() + Eigen::Vector3d(0, turn * ride.speed_mps, 0);
    Eigen::Vector3d rate = turn * up.normalized() + Eigen::Vector3d(5e-4, -5e-4, 5e-4);
    if (std::abs(t - 30) < kDtS / 2) rate.x() += roll / kDtS;
    for (int axis = 0; axis < 3; ++axis) {
      force(axis) += 0.1 * random.normal();
      rate(axis) += 0.01 * random.normal();
    }
    orientation.add(rate, force, corrected ? motion : ExpectedMotion{}, kDtS);
  }
  return orientation;
}

TEST(Orientation, PlainMadgwickReadsACurveAsRollAndOursDoesNot) {
  const double false_roll_rad = std::atan(14.0 * 14 / 350 / core::kGravityMps2);  // 3.3 degrees
  EXPECT_NEAR(after({}, false).roll_rad(), false_roll_rad, 0.4 * kDegree);
  EXPECT_NEAR(after({}, true).roll_rad(), 0, 0.4 * kDegree);
}

TEST(Orientation, RollOfTheBodyAndGradeAreRead) {
  const Ride ride{25, 800, 4 * kDegree, 1.5 * kDegree};
  const auto orientation = after(ride, true);
  EXPECT_NEAR(orientation.roll_rad(), 4 * kDegree, 0.6 * kDegree);
  EXPECT_NEAR(orientation.pitch_rad(), -1.5 * kDegree, 0.6 * kDegree);
}

}  // namespace
}  // namespace railfix::fusion
