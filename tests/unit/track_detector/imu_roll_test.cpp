#include "track_detector/imu_roll.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "core/random.hpp"
#include "core/time.hpp"
#include "core/units.hpp"
#include "synthetic_picture.hpp"

namespace {

using namespace railfix::track_detector;
using railfix::core::kNsPerSecond;
using railfix::core::kPi;
using railfix::core::Random;

constexpr double kLimitRad = 0.008;
constexpr int64_t kBegin = 1'700'000'000 * kNsPerSecond;
constexpr double kGyroHz = 200;

/// A body that sways at two frequencies near the resonance, on a track that twists in ramps, and its gyro.
struct Ride {
  double slow_rad = 0.002;
  double twist_rps = 0.015;  // in each ramp of 3 s, every 12 s, to either side
  double bias_rps = 0.0005;
  [[nodiscard]] double roll(double t) const {
    return slow_rad + 0.008 * std::sin(2 * kPi * 0.6 * t) + 0.006 * std::sin(2 * kPi * 1.1 * t + 1);
  }
  [[nodiscard]] double rate(double t, Random& random) const {
    const double sway =
        0.008 * 2 * kPi * 0.6 * std::cos(2 * kPi * 0.6 * t) + 0.006 * 2 * kPi * 1.1 * std::cos(2 * kPi * 1.1 * t + 1);
    const double in_ramp = std::fmod(t, 12.0) < 3 ? (std::fmod(t, 24.0) < 12 ? twist_rps : -twist_rps) : 0.0;
    return sway + in_ramp + bias_rps + random.normal(0, 0.002);
  }
};

int64_t ns(double t) {
  return kBegin + railfix::core::to_ns(t);
}

/// Samples of (from, to].
void feed(ImuRoll& imu, const Ride& ride, double from, double to, Random& random) {
  for (double t = from + 1 / kGyroHz; t <= to + 1e-9; t += 1 / kGyroHz) imu.add(ns(t), ride.rate(t, random));
}

TEST(ImuRoll, NarrowsTheRollAndItsSigmaHoldsAlsoWhereTheTrackTwists) {
  const Ride ride;
  ImuRoll imu({}, test::kMount, kLimitRad);
  Random random(3);
  double squares = 0;
  double of_limits = 0;
  int count = 0;
  for (double t = 0; t < 120; t += 1 / 30.0) {
    feed(imu, ride, t - 1 / 30.0, t, random);
    const auto hint = imu.at(ns(t));
    if (t < 2) continue;
    ASSERT_TRUE(hint);
    const double error = hint->roll_rad - ride.roll(t);
    EXPECT_LT(hint->sigma_rad, 0.85 * kLimitRad);
    EXPECT_LT(std::abs(error), 3 * hint->sigma_rad) << t;
    squares += error * error / (hint->sigma_rad * hint->sigma_rad);
    of_limits += ride.roll(t) * ride.roll(t) / (kLimitRad * kLimitRad);
    ++count;
  }
  EXPECT_LT(std::sqrt(squares / count), 1.1);
  EXPECT_LT(std::sqrt(squares / count), std::sqrt(of_limits / count)) << "the mount alone would be as good";
}

TEST(ImuRoll, ASampleThatNoBodyTurnsIsLeftOut) {
  ImuRoll sound({}, test::kMount, kLimitRad);
  ImuRoll hit({}, test::kMount, kLimitRad);
  Random random(2);
  Random same(2);
  feed(sound, {}, 0, 1, random);
  feed(hit, {}, 0, 1, same);
  hit.add(ns(1.001), 30);
  hit.add(ns(1.002), 1e300);
  feed(sound, {}, 1, 2, random);
  feed(hit, {}, 1, 2, same);
  sound.at(ns(1.95));
  hit.at(ns(1.95));
  EXPECT_EQ(hit.at(ns(2)).value().roll_rad, sound.at(ns(2)).value().roll_rad);
}

TEST(ImuRoll, SaysNothingWithoutSamplesOrWithOldOnesOnly) {
  ImuRoll imu({}, test::kMount, kLimitRad);
  EXPECT_FALSE(imu.at(ns(0)));
  Random random(1);
  feed(imu, {}, 0, 1, random);
  imu.at(ns(1));
  EXPECT_TRUE(imu.at(ns(1.1)));
  EXPECT_FALSE(imu.at(ns(3))) << "the gyro has stopped";
  imu.add(ns(4), std::nan(""));
  EXPECT_FALSE(imu.at(ns(4)));
}

TEST(ImuRoll, DoesNotDependOnWhetherTheNewestSamplesComeBeforeOrBehindThePicture) {
  const Ride ride;
  ImuRoll early({}, test::kMount, kLimitRad);
  ImuRoll late({}, test::kMount, kLimitRad);
  Random random_early(5);
  Random random_late(5);
  for (double t = 0.05; t < 3; t += 0.05) {
    feed(early, ride, t - 0.05, t, random_early);
    const auto a = early.at(ns(t));
    const auto b = late.at(ns(t));
    feed(late, ride, t - 0.05, t, random_late);
    ASSERT_EQ(a.has_value(), b.has_value());
    if (a) {
      EXPECT_EQ(a->roll_rad, b->roll_rad);
    }
  }
}

TEST(ImuRoll, BeginsAnewWhenTheDataDo) {
  Random random(7);
  ImuRoll imu({}, test::kMount, kLimitRad);
  feed(imu, {}, 100, 102, random);
  imu.at(ns(101.9));
  ASSERT_TRUE(imu.at(ns(102)));
  feed(imu, {}, 0, 1, random);
  imu.at(ns(0.9));
  EXPECT_TRUE(imu.at(ns(1)));
}

// What the service does with every picture: the gyro's prior goes into the rails' fit.
TEST(ImuRoll, ShrinksTheRollOfThePictureAndTheErrorStaysInside) {
  const Ride ride;
  ImuRoll imu({}, test::kMount, kLimitRad);
  Random random(11);
  TrackDetector with(test::kCab, test::kMount, {});
  TrackDetector without(test::kCab, test::kMount, {});
  feed(imu, ride, 0, 14.8, random);
  imu.at(ns(14.8));
  for (double t = 15.0; t < 15.5; t += 0.1) {
    feed(imu, ride, t - 0.2, t, random);
    const auto hint = imu.at(ns(t));
    ASSERT_TRUE(hint);
    test::Scene scene;
    scene.shape.camera = test::kMount;
    scene.shape.camera.roll_rad += ride.roll(t);
    const cv::Mat picture = test::render(scene);
    const auto a = with.detect(picture, hint);
    const auto b = without.detect(picture);
    ASSERT_TRUE(a.seen() && b.seen());
    for (const int k : {0, 2, 3}) {  // roll, and what straight rails tie to it: yaw, sideways position
      EXPECT_LT(a.covariance(k, k), 0.75 * b.covariance(k, k)) << k;
      const double error = to_vector(a.shape)(k) - to_vector(scene.shape)(k);
      EXPECT_LT(std::abs(error), 3 * std::sqrt(a.covariance(k, k))) << k;
    }
  }
}

}  // namespace
