// What a wheel can do to a train that no camera watches: readings that scatter, pulses that were lost, slips nobody
// sees.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "core/random.hpp"
#include "core/time.hpp"
#include "fusion/fusion.hpp"
#include "fusion/wheel_noise.hpp"
#include "straight_run.hpp"

namespace railfix::fusion::wheel_test {
namespace {

using testing::HasSubstr;

constexpr double kPeriodS = 0.05;

// A train on a straight line. Truth is kept in metres since the start.
class Train {
 public:
  Train() { fusion_.emplace(fusion_at(kStartM)); }

  bool camera = true;  // false: there is none, or it is silent
  bool blind = false;  // it says that it sees nothing
  bool wheel = true;   // its samples arrive
  bool imu = true;
  bool gnss = false;
  double slip = 0;       // share that the wheel counts too much
  double stray = 0;      // ... and the camera
  double noise_m = 0;    // of the wheel's readings
  double bias_mps2 = 0;  // of the accelerometer
  double speed_mps = 0;
  double way_m = 0;
  double worst_error_m = 0;  // since it was set to 0 last
  void leap(int64_t pulses) { wheel_m_ += static_cast<double>(pulses) / 90; }
  std::optional<TrainEstimate> state;
  void pass_landmark() {
    const auto forward = track::Direction::forward;
    fusion_->add(FixInput{now(), 1, kStartM + way_m, 0.1, 0.9999, ++landmarks_, FixKind::landmark, forward, nullptr});
  }
  /// By map_matcher, of what it sights.
  void say_nowhere() {
    fusion_->add(FixInput{now(), 1, kStartM + way_m, INFINITY, 0.01, 0, FixKind::track, track::Direction::forward,
                          nullptr, SightingsFit::nowhere});
  }

  /// Runs so long with this acceleration; every state must hold the train.
  void run(double time_s, double acceleration_mps2 = 0) {
    for (int i = 0; i < std::lround(time_s / kPeriodS); ++i) {
      const double step_m = speed_mps * kPeriodS + 0.5 * acceleration_mps2 * kPeriodS * kPeriodS;
      speed_mps += acceleration_mps2 * kPeriodS;
      way_m += step_m;
      wheel_m_ += step_m * (1 + slip);
      ++ticks_;
      if (gnss && ticks_ % 20 == 0) see(fusion_->add(GnssInput{now(), 0, kStartM + way_m, 1, 1}));
      if (imu) see(fusion_->add(ImuInput{now(), acceleration_mps2 + bias_mps2 + 0.05 * random_.normal(), 0}));
      const double reading_m = wheel_m_ + noise_m * random_.normal();
      if (wheel) see(fusion_->add(WheelInput{now(), static_cast<int64_t>(std::floor(reading_m * 90)), 90}));
      if (camera)
        see(fusion_->add(
            OdometryInput{now(), now() - core::to_ns(kPeriodS), blind ? 0 : step_m * (1 + stray), 0.002, !blind}));
    }
  }

 private:
  [[nodiscard]] int64_t now() const { return 1'600'000'000'000'000'000 + ticks_ * core::to_ns(kPeriodS); }
  void see(const std::optional<TrainEstimate>& next) {
    if (!next) return;
    state = next;
    if (next->stamp_ns != now()) return;
    const double error_m = next->distance_m - way_m;
    worst_error_m = std::max(worst_error_m, std::abs(error_m));
    EXPECT_LE(error_m, next->over_m) << state->reason << " at tick " << ticks_;
    EXPECT_LE(-error_m, next->under_m) << state->reason << " at tick " << ticks_;
  }

  core::Random random_{7};
  std::optional<Fusion> fusion_;
  static constexpr double kStartM = 1000;
  uint32_t landmarks_ = 0;
  int64_t ticks_ = 0;
  double wheel_m_ = 0;
};

TEST(WheelNoise, IsLearntAndASlipIsNone) {
  core::Random random(3);
  WheelNoise quiet;
  WheelNoise slipping;
  WheelNoise noisy;
  for (int64_t i = 0; i < 100; ++i) {
    const double way_m = 1.5 * static_cast<double>(i);
    quiet.add(i * 50'000'000, std::floor(way_m * 90) / 90);
    slipping.add(i * 50'000'000, i < 90 ? way_m : 1.3 * way_m);
    noisy.add(i * 50'000'000, way_m + 0.1 * random.normal());
  }
  EXPECT_LT(quiet.sigma_m(), 0.008);
  EXPECT_LT(slipping.sigma_m(), 0.001);
  EXPECT_NEAR(noisy.sigma_m(), 0.1, 0.05);
}

TEST(Wheel, ReadingsThatScatterMoveNothingWhileTheCameraIsBlind) {
  Train train;
  train.run(60, 0.5);
  train.blind = true;
  train.run(9);
  train.noise_m = 0.1;
  train.worst_error_m = 0;
  train.run(15);
  EXPECT_LT(train.worst_error_m, 1.5);
  EXPECT_EQ(train.state->integrity, Integrity::degraded);
  EXPECT_THAT(train.state->reason, HasSubstr("wheel"));
}

// Whoever is right when the camera is back from a tunnel, it is not the wheel that it had found to slip.
TEST(Wheel, ThatTheCameraHadFoundOutDoesNotReplaceIt) {
  for (const double bias_mps2 : {-0.8, -0.6, -0.4, -0.3, -0.2, 0.2, 0.3, 0.4, 0.6, 0.8}) {
    for (const double slip : {-0.4, 0.4}) {
      SCOPED_TRACE(testing::Message() << "bias " << bias_mps2 << ", slip " << slip);
      Train train;
      train.run(60, 0.25);
      train.slip = slip;
      train.run(20);
      train.bias_mps2 = bias_mps2;
      train.blind = true;
      train.run(12);
      train.blind = false;
      train.run(20);
      for (int i = 0; i < 3; ++i) {
        train.pass_landmark();
        train.run(20);
      }
    }
  }
}

TEST(Wheel, WhatItCountedWhileItWasSilentIsNotBelieved) {
  Train train;
  train.run(30, 0.5);
  train.wheel = false;
  train.slip = -0.3;
  train.run(30, -0.5);
  train.run(10);
  train.blind = true;
  train.run(12);
  train.wheel = true;
  train.worst_error_m = 0;
  train.run(2);
  EXPECT_LT(train.worst_error_m, 3);
}

// sensor_gateway was away: the pulses of the gap are counted way, and may be slip.
TEST(Wheel, WhatItCountedInAGapIsNoSlipAndASlipInItIsHeld) {
  for (const double gap_s : {0.4, 1.0, 1.5}) {
    for (const double slip : {0.0, 0.3, -0.3}) {
      Train train;
      train.run(60, 0.2);
      train.wheel = train.imu = false;
      train.slip = slip;
      train.run(gap_s, 0.2);
      train.wheel = train.imu = true;
      train.slip = 0;
      train.run(0.1, 0.2);
      if (slip == 0) {
        EXPECT_EQ(train.state->reason, kOnlyTold) << gap_s;
      }
      train.run(5, 0.2);
      EXPECT_EQ(train.state->reason, kOnlyTold) << gap_s << " s with " << slip;
    }
  }
}

// Its rival without wheel once promised 19 km, because the clock was doubted for as long as the camera was away.
// A receiver that was switched off in between: sensor_gateway shows it as a leap.
TEST(Wheel, ACountThatWasLostIsHeldWhateverElseMeasures) {
  for (const bool camera : {true, false}) {
    for (const bool imu : {true, false}) {
      Train train;
      train.camera = camera;
      train.imu = imu;
      train.run(20, 0.8);
      train.run(20);
      train.wheel = false;
      train.run(8);
      train.wheel = true;
      train.leap(1 << 23);
      train.run(0.2);
      EXPECT_NE(train.state->integrity, Integrity::ok) << camera << imu;
      train.run(120);
      EXPECT_LT(std::abs(train.state->speed_mps - train.speed_mps), 0.5) << camera << imu;
    }
  }
}

TEST(Wheel, TheReturnOfASilentCameraDoesNotDoubtTheClock) {
  Train train;
  train.run(60, 0.5);
  train.camera = false;
  train.run(150);
  const double width_m = train.state->over_m + train.state->under_m;
  train.camera = true;
  train.run(1);
  EXPECT_LT(train.state->over_m + train.state->under_m, width_m + 20);
}

// Gently: no single sample of the IMU contradicts.
TEST(Wheel, ThatIsStuckWhileTheCameraIsBlindHidesNoStart) {
  Train train;
  train.run(25, 0.8);
  train.run(25, -0.8);
  train.slip = -1;
  train.run(5);
  train.blind = true;
  train.run(12);
  for (double acceleration_mps2 = 0.02; acceleration_mps2 < 0.6; acceleration_mps2 += 0.01)
    train.run(0.05, acceleration_mps2);
  train.run(10, 0.6);
  EXPECT_NE(train.state->integrity, Integrity::ok);
  train.blind = false;
  train.run(30);
}

// It turns again before the camera is back, and everything agrees.
TEST(Wheel, ThatWasLockedBetweenTwoHaltsInTheDarkIsNotForgotten) {
  Train train;
  train.run(25, 0.8);
  for (int i = 0; i < 5; ++i) {
    train.run(5, -0.8);
    train.pass_landmark();
  }
  train.run(5);
  train.blind = true;
  train.slip = -1;
  train.run(12);
  train.run(12, 0.06);
  train.run(8);
  train.run(12, -0.06);
  train.slip = 0;
  train.run(2);
  train.blind = false;
  train.run(20);
}

// So gently that it passes for a grade.
TEST(Wheel, ThatSlipsForAWhileInTheDarkIsNotForgotten) {
  Train train;
  train.run(20, 0.8);
  train.pass_landmark();
  train.blind = true;
  train.run(3);
  for (int i = 0; i < 40; ++i, train.slip += 0.005) train.run(0.3);
  train.run(10);
  for (int i = 0; i < 40; ++i, train.slip -= 0.005) train.run(0.3);
  train.run(2);
  train.blind = false;
  train.run(20);
}

// The same with a wheel that is well: no reason to promise less than with a camera.
TEST(Wheel, ThatTurnsWhileTheCameraIsBlindIsBelieved) {
  double length_m[2]{};
  for (const bool blind : {false, true}) {
    Train train;
    train.run(25, 0.8);
    train.blind = blind;
    for (int i = 0; i < 4; ++i) {
      train.run(3, -0.9);
      train.run(3, 0.9);
    }
    length_m[blind ? 1 : 0] = train.state->over_m + train.state->under_m;
  }
  EXPECT_LT(length_m[1], 1.05 * length_m[0]);
}

TEST(Wheel, AloneItAdmitsWhatASlipMayAdd) {
  Train train;
  train.camera = train.imu = false;
  train.run(40, 0.5);
  for (double slip = 0; slip < 0.25; slip += 0.001) {  // so slowly that no test on innovations sees it
    train.slip = slip;
    train.run(kPeriodS);
  }
  EXPECT_GT(train.worst_error_m, 20);
  train.slip = 0;
  train.run(10);
  EXPECT_NE(train.state->integrity, Integrity::ok);
  EXPECT_THAT(train.state->reason, HasSubstr("nothing would see it slip"));
}

/// From 20 m/s on, beside GNSS: each second the wheel turns a little slower, which neither an IMU nor its own readings
/// tell.
void slide_more_and_more(Train& train, bool imu, int seconds) {
  train.camera = false;
  train.imu = imu;
  train.gnss = true;
  train.run(20, 1);
  train.run(60);
  for (int second = 0; second < seconds; ++second) {
    train.slip -= 0.01;
    train.run(1);
  }
}

// GNSS tells, but may be wrong itself.
TEST(Wheel, ThatSlidesMoreAndMoreIsHeldByWhatGnssSays) {
  for (const bool imu : {false, true}) {
    Train train;
    slide_more_and_more(train, imu, 60);
    EXPECT_GT(train.worst_error_m, 100) << imu;
    EXPECT_THAT(train.state->reason, HasSubstr("GNSS contradicts the position"));
    EXPECT_NE(train.state->integrity, Integrity::ok);
    train.camera = true;  // it sees now, but not what was
    train.run(30);
  }
}

// What is sighted fits nowhere because the wheel has slid: the way that is counted on is as wrong as the place was.
TEST(Wheel, ThatSlidIsHeldByWhatGnssSaidAlsoWhenThePlaceIsGivenUp) {
  for (const bool imu : {false, true}) {
    Train train;
    slide_more_and_more(train, imu, 80);
    train.slip = 0;
    for (int second = 0; second < 90; ++second) {
      train.say_nowhere();
      train.run(1);
    }
    EXPECT_FALSE(train.state->track_known);
    EXPECT_GT(train.worst_error_m, 700) << imu;
  }
}

TEST(Wheel, ASlipFromTheStandHoldsWithAnImuAndTheWheelComesBack) {
  Train train;
  train.camera = false;
  train.run(20);
  train.slip = 0.15;
  train.run(6, 0.6);
  train.slip = 0;
  train.run(6, 0.6);
  train.run(30);
  EXPECT_NEAR(train.state->speed_mps, train.speed_mps, 0.3);
}

// Where the curvature of the rails changes the camera may measure 0.2 m too little, and the wheel is blamed for it.
TEST(Wheel, ASlipThatWasNoneIsUndone) {
  Train train;
  train.run(40, 1);
  train.run(60);
  const auto error_m = [&] { return train.state->distance_m - train.way_m; };
  const double before_m = error_m();
  train.stray = -0.005;
  train.run(1);
  train.stray = 0;
  train.run(0.5);
  EXPECT_THAT(train.state->reason, HasSubstr("wheel slips or slides"));
  train.run(2);
  EXPECT_EQ(train.state->reason, kOnlyTold);
  EXPECT_NEAR(error_m(), before_m, 0.05);
}

// The first reading tells the speed; that the scale adds to it nobody could know while none was known.
TEST(Wheel, AFusionThatBeginsAtSpeedTakesNoScaleForASlip) {
  for (const double stray : {-0.02, -0.012, 0.012, 0.02}) {
    Train train;
    train.speed_mps = 25;
    train.stray = stray;
    train.run(0.5);
    for (int i = 0; i < 10; ++i) {
      train.run(0.5);
      EXPECT_EQ(train.state->reason, kOnlyTold) << stray << " after " << i << " halves of a second";
    }
  }
}

TEST(Wheel, TheReasonSaysSinceWhenItIsDistrusted) {
  Train train;
  train.run(40, 0.5);  // the clock began at 12:26:40
  train.slip = 0.3;
  train.run(3);
  EXPECT_THAT(train.state->reason, HasSubstr("wheel slips or slides since 12:27:"));
}

}  // namespace
}  // namespace railfix::fusion::wheel_test
