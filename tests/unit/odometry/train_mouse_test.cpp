#include "odometry/train_mouse.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <map>

#include "core/time.hpp"
#include "unit/odometry/synthetic_ground.hpp"

namespace railfix::odometry {
namespace {

using test::SyntheticGround;

// A train on synthetic ground with the mouse behind it.
class Ride {
 public:
  explicit Ride(const SyntheticGround::Options& ground = {}, uint64_t seed = 1)
      : ground_(seed, ground), options_(ground), mouse_(test::small_camera(), {}) {}

  MouseStep at(double time_s, double distance_m) {
    return show(time_s, ground_.picture(test::small_camera(), shaken, distance_m, light));
  }
  // The last picture once more, a grey level off here and there as film that was coded anew.
  MouseStep again(double time_s) {
    cv::Mat coded = last_.clone();
    for (int i = 0; i < coded.rows * coded.cols; i += 5) coded.data[i] ^= 1U;
    return show(time_s, coded);
  }

  geometry::CameraPose shaken = test::cab_mount();
  std::optional<geometry::CameraPose> pose_used;
  PoseTrust trust = PoseTrust::independent(0.0003, 0.002);
  SyntheticGround::Light light;
  double exposure_s = 0;  // as it is told; the pictures are sharp
  bool mount_guessed = false;
  double wrong_curvature_per_m = 0;  // added to what is told

 private:
  MouseStep show(double time_s, const cv::Mat& grey) {
    last_ = grey;
    MousePicture picture;
    picture.grey = grey;
    picture.stamp_ns = 1'700'000'000'000'000'000 + core::to_ns(time_s);
    picture.pose = pose_used.value_or(shaken);
    picture.pose_measured = true;
    picture.exposure_s = exposure_s;
    picture.mount_guessed = mount_guessed;
    picture.trust = trust;
    picture.curvature_per_m = options_.curvature_per_m + wrong_curvature_per_m;
    picture.vertical_curvature_per_m = options_.vertical_curvature_per_m;
    return mouse_.process(picture);
  }

  SyntheticGround ground_;
  SyntheticGround::Options options_;
  TrainMouse mouse_;
  cv::Mat last_;
};

constexpr double kRate = 30.0;

TEST(TrainMouse, MeasuresSteadyMotion) {
  Ride ride;
  MouseStep step;
  for (int i = 0; i <= 40; ++i) step = ride.at(i / kRate, 0.5 * i);
  EXPECT_TRUE(step.valid);
  EXPECT_EQ(step.mode, MouseMode::track);
  EXPECT_NEAR(step.distance_m, 20.0, 0.01);
  EXPECT_NEAR(step.speed_mps, 15.0, 0.05);
  EXPECT_NEAR(step.step_m, 0.5, 0.003);
  EXPECT_NEAR(step.height_m, 2.78, 1e-9);
}

TEST(TrainMouse, MeasuresReverse) {
  Ride ride;
  MouseStep step;
  for (int i = 0; i <= 20; ++i) step = ride.at(i / kRate, -0.3 * i);
  EXPECT_TRUE(step.valid);
  EXPECT_NEAR(step.distance_m, -6.0, 0.006);
}

// 18 m/s at 30 Hz is one sleeper a picture.
TEST(TrainMouse, IsNotDeceivedBySleepers) {
  SyntheticGround::Options ground;
  ground.stone_contrast = 12;
  ground.sleeper_contrast = 60;
  Ride ride(ground);
  MouseStep step;
  for (int i = 0; i <= 20; ++i) step = ride.at(i / kRate, 0.6 * i);
  EXPECT_TRUE(step.valid);
  EXPECT_NEAR(step.distance_m, 12.0, 0.03);
}

// 36 m/s at 60 Hz is exactly one sleeper a picture, from a cold start and again after a gap.
TEST(TrainMouse, OneSleeperAPictureIsNotStandstill) {
  SyntheticGround::Options ground;
  ground.stone_contrast = 12;
  ground.sleeper_contrast = 60;
  Ride ride(ground, 4);
  MouseStep step;
  for (int i = 0; i <= 30; ++i) {
    if (i >= 10 && i < 20) continue;
    step = ride.at(i / 60.0, 0.6 * i);
    EXPECT_TRUE(step.valid || i < 2 || (i >= 20 && i < 22)) << i;
    if (step.valid) {
      EXPECT_NEAR(step.speed_mps, 36.0, 0.4) << i;
    }
  }
  EXPECT_NEAR(step.distance_m, 18.0, 0.05);
}

// All shifts by a sleeper look alike then, over the whole width.
TEST(TrainMouse, SaggingSleepersHaveNoVote) {
  SyntheticGround::Options ground;
  ground.stone_contrast = 12;
  ground.sleeper_contrast = 60;
  ground.sleeper_bow_m = 0.15;
  Ride ride(ground);
  for (int i = 0; i < 5; ++i) {  // a picture a second: no motion is known beforehand
    const MouseStep step = ride.at(i, 2.1 * i);
    EXPECT_EQ(step.valid, i >= 2) << i;
    if (step.valid) {
      EXPECT_NEAR(step.step_m, 2.1, 0.01) << i;
    }
  }
}

TEST(TrainMouse, TurnsBackWithoutAStop) {
  Ride ride;
  for (int i = 0; i <= 40; ++i) {
    const double time_s = i / 20.0;
    const double distance_m = 3.0 * time_s - 1.5 * time_s * time_s;
    const MouseStep step = ride.at(time_s, distance_m);
    EXPECT_TRUE(step.valid || i < 2) << i;
    if (step.valid) {
      EXPECT_NEAR(step.distance_m, distance_m, 0.008) << i;
    }
  }
}

TEST(TrainMouse, StandsStillExactly) {
  Ride ride;
  MouseStep step;
  int i = 0;
  double distance_m = 0;
  for (; i < 8; ++i) step = ride.at(i / kRate, distance_m += 0.02 * (8 - i) / 8.0);
  for (int k = 0; k < 6; ++k) step = ride.at(i++ / kRate, distance_m);
  const double stopped_m = step.distance_m;
  EXPECT_NEAR(stopped_m, distance_m - 0.02, 0.004);
  const auto mount = ride.shaken;
  core::Random random(3);
  for (int k = 0; k < 40; ++k) {
    ride.pose_used = mount;  // the measured pose is noisy, the camera is not
    ride.pose_used->pitch_rad += random.normal(0, 3e-4);
    step = ride.at(i++ / kRate, distance_m);
    ASSERT_TRUE(step.valid);
    EXPECT_EQ(step.distance_m, stopped_m);
    EXPECT_EQ(step.speed_mps, 0.0);
  }
  EXPECT_EQ(step.mode, MouseMode::keyframe);
}

TEST(TrainMouse, CreepingDoesNotDrift) {
  Ride ride;
  MouseStep step;
  for (int i = 0; i <= 60; ++i) step = ride.at(i / kRate, 0.004 * i);
  EXPECT_TRUE(step.valid);
  EXPECT_NEAR(step.distance_m, 0.24, 0.004);
}

TEST(TrainMouse, ExposureStepsDoNotMatter) {
  Ride ride;
  MouseStep step;
  for (int i = 0; i <= 20; ++i) {
    ride.light.gain = i % 3 == 0 ? 0.5 : 1.2;
    ride.light.bias = i % 2 == 0 ? 15 : 0;
    step = ride.at(i / kRate, 0.4 * i);
  }
  EXPECT_TRUE(step.valid);
  EXPECT_NEAR(step.distance_m, 8.0, 0.01);
}

// The train's own shadow stands still in the picture over the left half of the ground, its edge along and across.
TEST(TrainMouse, OwnShadowDoesNotHoldItBack) {
  Ride ride;
  ride.light.shade = [](double u, double v) { return u < 310 && v > 250 ? 0.45 : 1.0; };
  MouseStep step;
  for (int i = 0; i <= 20; ++i) step = ride.at(i / kRate, 0.4 * i);
  EXPECT_TRUE(step.valid);
  EXPECT_NEAR(step.distance_m, 8.0, 0.012);
}

// Every sixth picture, as film of 25 Hz that was coded anew for 30.
TEST(TrainMouse, APictureShownAgainIsNotStandstill) {
  Ride ride;
  MouseStep step;
  for (int i = 0; i <= 60; ++i) {
    const bool repeated = i > 12 && i % 6 == 0 && i < 60;
    step = repeated ? ride.again(i / kRate) : ride.at(i / kRate, 20.0 / kRate * i);
    EXPECT_EQ(step.valid, i >= 2 && !repeated) << i;
    if (repeated) {
      EXPECT_EQ(step.mode, MouseMode::blind);
    }
    if (step.valid) {
      EXPECT_NEAR(step.speed_mps, 20, 0.3) << i;
    }
  }
  EXPECT_NEAR(step.distance_m, 40, 0.03);
}

TEST(TrainMouse, NorIsAPictureShownForASecond) {
  Ride ride;
  MouseStep step;
  for (int i = 0; i <= 80; ++i) {
    const bool repeated = i > 30 && i <= 60;
    step = repeated ? ride.again(i / kRate) : ride.at(i / kRate, 20.0 / kRate * i);
    EXPECT_FALSE(step.valid && repeated) << i;
  }
  EXPECT_TRUE(step.valid);
  EXPECT_NEAR(step.distance_m, 20.0 / kRate * 80, 0.2) << "bridged";
}

// As when a picture waits in a driver until the next one comes.
TEST(TrainMouse, PicturesStampedCloseTogetherGiveNoSpeed) {
  for (const double gap_s : {1e-5, 1e-3}) {
    Ride ride;
    MouseStep step;
    for (int i = 0; i <= 40; ++i) {
      step = ride.at(i == 20 ? 21 / kRate - gap_s : i / kRate, 10.0 / kRate * i);
      EXPECT_TRUE(step.valid || i < 2) << i;
      if (step.valid) {
        EXPECT_NEAR(step.speed_mps, 10, 3) << i;
      }
    }
    EXPECT_NEAR(step.speed_mps, 10, 0.1);
    EXPECT_NEAR(step.distance_m, 10.0 / kRate * 40, 0.02);
  }
}

// The speed on either side of a gap is what the second before says, though the stamps beside the gap are wrong.
TEST(TrainMouse, AGapIsNotBridgedWithTheSpeedOfWrongStamps) {
  constexpr double kClose = 1e-5;
  for (const int late : {20, 52}) {  // the picture that waits for the next one: before and after the gap
    Ride ride;
    MouseStep step;
    for (int i = 0; i <= 70; ++i) {
      const bool covered = i > 21 && i <= 50;
      ride.light.gain = covered ? 0 : 1;
      ride.light.noise = covered ? 0.5 : 2;
      step = ride.at(i == late ? (i + 1) / kRate - kClose : i / kRate, 10.0 / kRate * i);
    }
    EXPECT_TRUE(step.valid);
    EXPECT_NEAR(step.distance_m, 10.0 / kRate * 70, 1.5) << late;
  }
}

TEST(TrainMouse, OnePoseWithANumberThatIsNoneCostsNothing) {
  Ride ride;
  MouseStep step;
  for (int i = 0; i <= 30; ++i) {
    ride.wrong_curvature_per_m = i == 15 ? std::nan("") : 0;
    step = ride.at(i / kRate, 0.4 * i);
    EXPECT_TRUE(step.valid || i < 2) << i;
  }
  EXPECT_NEAR(step.distance_m, 12, 0.02);
  ride.pose_used = ride.shaken;
  ride.pose_used->pitch_rad = std::nan("");
  EXPECT_FALSE(ride.at(31 / kRate, 0.4 * 31).valid);
  ride.pose_used.reset();
  EXPECT_TRUE(ride.at(32 / kRate, 0.4 * 32).valid);
}

// A picture a second at 10 m/s: the ground is gone each time, only the lettering on the picture is found again.
TEST(TrainMouse, LetteringOnThePictureIsNotStandstill) {
  Ride ride;
  ride.light.shade = [](double u, double v) {
    return v > 380 && v < 470 && (static_cast<int>(u / 5) * 7919 + static_cast<int>(v / 6) * 104729) % 5 == 0 ? 2.5
                                                                                                              : 1.0;
  };
  for (int i = 0; i < 8; ++i) EXPECT_FALSE(ride.at(i, 10.3 * i).valid) << i;
}

TEST(TrainMouse, DarkIsBlindAndNotStandstill) {
  Ride ride;
  MouseStep step;
  for (int i = 0; i < 10; ++i) step = ride.at(i / kRate, 0.4 * i);
  ASSERT_TRUE(step.valid);
  ride.light.gain = 0.0;
  ride.light.noise = 0.5;
  for (int i = 10; i < 20; ++i) {
    step = ride.at(i / kRate, 0.4 * i);
    EXPECT_FALSE(step.valid);
    EXPECT_EQ(step.mode, MouseMode::blind);
  }
  ride.light.gain = 1.0;
  ride.light.noise = 2.0;
  for (int i = 20; i < 30; ++i) step = ride.at(i / kRate, 0.4 * i);
  EXPECT_TRUE(step.valid);
  EXPECT_NEAR(step.speed_mps, 12.0, 0.1);
  EXPECT_NEAR(step.distance_m, 11.6, 0.05);  // the gap is bridged with the speed
}

TEST(TrainMouse, DroppedPicturesAreBridgedByTheirStamps) {
  Ride ride;
  MouseStep step;
  for (int i = 0; i <= 40; ++i) {
    if (i % 5 == 3 || i == 20 || i == 21) continue;
    step = ride.at(i / kRate, 0.35 * i);
    EXPECT_TRUE(step.valid || i <= 2) << i;
  }
  EXPECT_NEAR(step.distance_m, 14.0, 0.012);
}

TEST(TrainMouse, LatePictureIsLeftOut) {
  Ride ride;
  for (int i = 0; i < 6; ++i) ride.at(i / kRate, 0.4 * i);
  EXPECT_EQ(ride.at(3.5 / kRate, 0.4 * 3.5).why, MouseWhy::not_newer);
  const MouseStep step = ride.at(6 / kRate, 2.4);
  EXPECT_TRUE(step.valid);
  EXPECT_NEAR(step.distance_m, 2.4, 0.012);
}

TEST(TrainMouse, NoisyStampsDoNotChangeTheDistance) {
  Ride ride;
  core::Random random(5);
  MouseStep step;
  for (int i = 0; i <= 30; ++i) {
    step = ride.at(i / kRate + std::clamp(random.normal(0, 0.005), -0.012, 0.012), 0.5 * i);
    EXPECT_TRUE(step.valid || i < 2) << i;
  }
  EXPECT_NEAR(step.distance_m, 15.0, 0.012);
}

// One stamp an hour ahead of the others must not end the measuring for an hour.
TEST(TrainMouse, BeginsAnewWhenTheClockIsSetBack) {
  Ride ride;
  MouseStep step;
  for (int i = 0; i < 6; ++i) step = ride.at(i / kRate, 0.4 * i);
  const double before_m = ride.at(3600, 2.4).distance_m;
  for (int i = 7; i < 12; ++i) step = ride.at(i / kRate, 0.4 * i);
  EXPECT_TRUE(step.valid);
  EXPECT_NEAR(step.speed_mps, 12.0, 0.1);
  EXPECT_GT(step.distance_m, before_m + 0.8);
  EXPECT_LT(step.distance_m, 0.4 * 11 + 0.05);
}

TEST(TrainMouse, AStampThatJumpsIsNoSpeed) {
  Ride ride;
  MouseStep step;
  for (int i = 0; i <= 30; ++i) {
    step = ride.at(i / kRate + (i >= 15 ? 2.0 : 0.0), 0.25 * i);
    EXPECT_EQ(step.valid, i >= 2 && i != 15) << i;
    EXPECT_EQ(step.why == MouseWhy::stamps_jump, i == 15) << i;
    if (step.valid) {
      EXPECT_NEAR(step.speed_mps, 7.5, 0.3) << i;
      EXPECT_NEAR(step.distance_m, 0.25 * i, 0.02) << i;
    }
  }
}

TEST(TrainMouse, OneStampAnHourAheadCostsNoWay) {
  Ride ride;
  MouseStep step;
  for (int i = 0; i <= 30; ++i) {
    step = ride.at(i == 15 ? 3600 : i / kRate, 0.25 * i);
    if (step.valid) {
      EXPECT_NEAR(step.speed_mps, 7.5, 0.3) << i;
    }
  }
  EXPECT_TRUE(step.valid);
  EXPECT_NEAR(step.distance_m, 0.25 * 30, 0.05);
}

// As from cameras whose pictures are stamped as they come.
TEST(TrainMouse, SigmaHoldsPicturesInTheWrongOrder) {
  for (const double picture_m : {0.13, 0.35}) {
    Ride ride;
    std::map<int64_t, double> true_m;
    int seen = 0;
    for (int i = 0; i <= 60; ++i) {
      const int shown = i > 20 && i % 5 == 0 ? i + 1 : i > 20 && i % 5 == 1 ? i - 1 : i;
      const MouseStep step = ride.at(i / kRate, picture_m * shown);
      true_m[step.stamp_ns] = picture_m * i;
      if (!step.valid || i < 4) continue;
      const double error_m = step.step_m - (true_m[step.stamp_ns] - true_m[step.reference_stamp_ns]);
      EXPECT_LT(std::abs(error_m), 4 * step.step_sigma_m) << i;
      if (step.off_m != 0) ++seen;
    }
    EXPECT_GT(seen, 10) << picture_m;
  }
}

// Below the speed at which a repeated picture is no answer at all.
TEST(TrainMouse, SigmaHoldsASlowPictureShownAgain) {
  Ride ride;
  double before_m = 0;
  for (int i = 0; i <= 40; ++i) {
    const bool repeated = i > 12 && i % 6 == 0;
    const MouseStep step = repeated ? ride.again(i / kRate) : ride.at(i / kRate, 0.018 * i);
    if (repeated && step.valid) {
      const double error_m = step.distance_m - before_m - 0.018;
      EXPECT_LT(std::abs(error_m), 3 * step.step_sigma_m) << i;
    }
    before_m = step.distance_m;
  }
}

TEST(TrainMouse, FromAGuessedMountOnlyRestIsKnown) {
  Ride ride;
  ride.mount_guessed = true;
  for (int i = 0; i <= 60; ++i) {
    const double since_s = std::max(0.0, i / kRate - 0.5);
    const MouseStep step = ride.at(i / kRate, since_s * since_s);
    if (i <= 15 || i > 20) {
      EXPECT_EQ(step.valid, i >= 2 && i <= 15) << i;
    }
    if (i > 20) {
      EXPECT_EQ(step.why, MouseWhy::mount_guessed) << i;
      EXPECT_GE(step.step_sigma_m, 0.2 * step.step_m) << i;
    }
    if (step.valid) {
      EXPECT_EQ(step.speed_mps, 0) << i;
    }
  }
}

TEST(TrainMouse, ShakeOfTheCameraIsNotMotion) {
  Ride ride;
  ride.trust = PoseTrust::independent(1e-5, 1e-4);
  const auto mount = ride.shaken;
  MouseStep step;
  for (int i = 0; i <= 30; ++i) {
    ride.shaken.pitch_rad = mount.pitch_rad + 0.003 * std::sin(0.7 * i);
    ride.shaken.roll_rad = 0.004 * std::sin(0.4 * i + 1);
    ride.shaken.yaw_rad = 0.003 * std::sin(0.5 * i);
    ride.shaken.lateral_m = 0.02 * std::sin(0.3 * i);
    ride.shaken.height_m = mount.height_m + 0.01 * std::sin(0.6 * i);
    step = ride.at(i / kRate, 0.3 * i);
  }
  EXPECT_TRUE(step.valid);
  EXPECT_NEAR(step.distance_m, 9.0, 0.012);
}

// Shake that nobody has measured: the ground itself tells it from motion.
TEST(TrainMouse, PoseNoiseDoesNotReachTheSteps) {
  Ride ride;
  const auto mount = ride.shaken;
  ride.trust = PoseTrust::independent(0.001, 0.003);
  core::Random random(5);
  double worst_m = 0;
  double before_m = 0;
  for (int i = 0; i <= 40; ++i) {
    ride.pose_used = mount;
    ride.pose_used->pitch_rad += random.normal(0, 0.001);  // 30 mm at 9 m
    const MouseStep step = ride.at(i / kRate, 0.5 * i);
    if (i > 5) {
      worst_m = std::max(worst_m, std::abs(step.step_m - 0.5));
      EXPECT_NEAR(step.distance_m - before_m, step.step_m, 1e-9) << "steps add up to the distance";
    }
    before_m = step.distance_m;
  }
  EXPECT_LT(worst_m, 0.012);
}

TEST(TrainMouse, CurveIsMeasuredAlongTheTrack) {
  SyntheticGround::Options ground;
  ground.curvature_per_m = -1.0 / 250.0;
  Ride ride(ground);
  MouseStep step;
  for (int i = 0; i <= 30; ++i) step = ride.at(i / kRate, 0.6 * i);
  EXPECT_TRUE(step.valid);
  EXPECT_NEAR(step.distance_m, 18.0, 0.015);
  EXPECT_NEAR(step.yaw_rad / step.step_m, -1.0 / 250.0, 3e-4);
}

// The sheet is laid for a straight track, the ground curves: the turn shows all the same.
TEST(TrainMouse, UnknownCurveShowsAsTurn) {
  SyntheticGround::Options ground;
  ground.curvature_per_m = 1.0 / 600.0;
  SyntheticGround scene(7, ground);
  TrainMouse mouse(test::small_camera(), {});
  double turn_rad = 0;
  MouseStep step;
  for (int i = 0; i <= 20; ++i) {
    MousePicture picture;
    picture.grey = scene.picture(test::small_camera(), test::cab_mount(), 0.6 * i, {});
    picture.stamp_ns = core::to_ns(1 + i / kRate);
    picture.pose = test::cab_mount();
    step = mouse.process(picture);
    if (step.valid && i > 2) turn_rad += step.yaw_rad;
  }
  EXPECT_TRUE(step.valid);
  EXPECT_NEAR(turn_rad / (18 * 0.6), 1.0 / 600.0, 2e-4);
}

TEST(TrainMouse, TurnsWithTheCamera) {
  Ride ride;
  const auto yaw_rad = [](int i) { return 0.003 * std::sin(0.5 * i); };
  double turn_rad = 0;
  for (int i = 0; i <= 20; ++i) {
    ride.shaken.yaw_rad = yaw_rad(i);
    const MouseStep step = ride.at(i / kRate, 0.6 * i);
    if (i > 2) turn_rad += step.yaw_rad;
    EXPECT_NEAR(turn_rad, i > 2 ? yaw_rad(i) - yaw_rad(2) : 0, 5e-4) << i;
  }
}

// Behind points the rails that are seen may be those of the other leg: the train runs on straight.
TEST(TrainMouse, TurnsWithTheCameraAndNotWithTheRailsThatItSees) {
  constexpr double kOtherLegPerM = 1.0 / 300.0;
  SyntheticGround scene(7, {});
  TrainMouse mouse(test::small_camera(), {});
  double turn_rad = 0;
  MouseStep step;
  for (int i = 0; i <= 15; ++i) {
    const double at_m = 0.6 * i;
    MousePicture picture;
    picture.grey = scene.picture(test::small_camera(), test::cab_mount(), at_m, {});
    picture.stamp_ns = core::to_ns(1 + i / kRate);
    picture.pose = test::cab_mount();
    picture.pose.yaw_rad -= kOtherLegPerM * at_m;
    picture.pose.lateral_m -= 0.5 * kOtherLegPerM * at_m * at_m;
    picture.pose_measured = true;
    picture.curvature_per_m = kOtherLegPerM;
    step = mouse.process(picture);
    if (step.valid && i > 2) turn_rad += step.yaw_rad;
  }
  EXPECT_TRUE(step.valid);
  EXPECT_NEAR(turn_rad / (13 * 0.6), 0, 3e-4);
}

TEST(TrainMouse, LastingPitchErrorIsFoundFromTheGround) {
  Ride ride;
  ride.trust = PoseTrust::independent(0.0003, 0.002);
  ride.pose_used = ride.shaken;
  ride.pose_used->pitch_rad += 0.001;
  MouseStep step;
  for (int i = 0; i <= 60; ++i) step = ride.at(i / kRate, 0.6 * i);
  EXPECT_NEAR(step.pitch_bias_rad, 0.001, 3e-4);
}

TEST(TrainMouse, SigmaIsHonest) {
  Ride ride;
  double sum = 0;
  int count = 0;
  for (int i = 0; i <= 60; ++i) {
    const MouseStep step = ride.at(i / kRate, 0.55 * i);
    if (!step.valid) continue;
    const double error = (step.step_m - 0.55) / step.step_sigma_m;
    sum += error * error;
    ++count;
  }
  ASSERT_GT(count, 50);
  EXPECT_LT(std::sqrt(sum / count), 2.0);
  EXPECT_GT(std::sqrt(sum / count), 0.15);
}

TEST(TrainMouse, SigmaHoldsMotionBlur) {
  const auto sigma_m = [](double exposure_s) {
    Ride ride;
    ride.light.noise = 20;
    ride.exposure_s = exposure_s;
    MouseStep step;
    for (int i = 0; i <= 8; ++i) step = ride.at(i / kRate, 24 / kRate * i);
    EXPECT_TRUE(step.valid);
    return step.step_sigma_m;
  };
  const double sharp_m = sigma_m(0);
  EXPECT_NEAR(sigma_m(0.002), sharp_m, 0.05 * sharp_m) << "by day";
  EXPECT_GT(sigma_m(0.03), 1.5 * sharp_m) << "at night";
}

TEST(TrainMouse, WrongSizeIsRefused) {
  TrainMouse mouse(test::small_camera(), {});
  MousePicture picture;
  picture.grey = cv::Mat::zeros(10, 10, CV_8UC1);
  picture.stamp_ns = 5;
  EXPECT_FALSE(mouse.process(picture).valid);
  EXPECT_EQ(mouse.process(picture).why, MouseWhy::other_size);
}

}  // namespace
}  // namespace railfix::odometry
