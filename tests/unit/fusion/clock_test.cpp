// Clocks: a wild stamp, a sensor that is ahead of the others, a clock that is set, a reference picture of before.
#include <limits>

#include "straight_run.hpp"

namespace railfix::fusion::clock_test {
namespace {

constexpr double kSpeedMps = 20;

// Camera, wheel and IMU at 50 Hz; whose clock is how far off, by the time of the train.
struct Offset {
  double camera_s = 0;
  double wheel_s = 0;
  double imu_s = 0;
};

class Train {
 public:
  explicit Train(bool has_camera = true, bool has_imu = true) : has_camera_(has_camera), has_imu_(has_imu) {}

  /// States whose interval does not hold the train are counted; those that have another clock are not looked at.
  void run_to(double t_s, const Offset& offset = {}) {
    for (; t_s_ < t_s; t_s_ += kPeriodS) {
      const double t = t_s_ + kPeriodS;
      if (has_imu_) hear(fusion.add(ImuInput{at(t + offset.imu_s), 0.001 * (samples_ % 7), 0}), offset.imu_s);
      hear(fusion.add(wheel_at(t + offset.wheel_s, kSpeedMps * t)), offset.wheel_s);
      auto step = step_at(t + offset.camera_s, kSpeedMps, kPeriodS);
      if (has_camera_) hear(fusion.add(step), offset.camera_s);
      ++samples_;
    }
  }
  void gnss(double early_s) { hear(fusion.add(GnssInput{at(t_s_ + early_s), 0, kSpeedMps * t_s_, 1, 1}), early_s); }

  Fusion fusion = fusion_at(0);
  std::optional<TrainEstimate> state;
  int states = 0;
  int outside = 0;

 private:
  static constexpr double kPeriodS = 0.02;

  void hear(std::optional<TrainEstimate> estimate, double offset_s) {
    if (!estimate) return;
    ++states;
    const double truth_m = kSpeedMps * (core::seconds(estimate->stamp_ns - kBeginNs) - offset_s);
    const double error_m = estimate->distance_m - truth_m;
    if (error_m > estimate->over_m || -error_m > estimate->under_m) ++outside;
    state = std::move(estimate);
  }

  bool has_camera_;
  bool has_imu_;
  double t_s_ = 0;
  int samples_ = 0;
};

TEST(Clock, OfOneSensorThatLeapsIsNotFollowed) {
  for (const double leap_s : {2.5, 18.0, 3600.0, 1e9}) {
    Train train;
    train.run_to(10);
    for (double t = 10; t < 40; ++t) {
      train.run_to(t);
      train.gnss(leap_s);
    }
    EXPECT_NE(train.state->reason.find("left out, its stamps are seconds from those of the odometers: GNSS"),
              std::string::npos)
        << leap_s << train.state->reason;
    train.run_to(41, {.imu_s = leap_s});
    train.run_to(60);
    EXPECT_EQ(train.state->reason, kOnlyTold) << leap_s;
    EXPECT_EQ(train.outside, 0) << leap_s;
    EXPECT_NEAR(train.states, 60 * 50, 5) << leap_s;
    EXPECT_NEAR(train.state->distance_m, 1200, 1) << leap_s;
    EXPECT_EQ(train.fusion.counts().clock_resets, 0U) << leap_s;
  }
}

// Stamps that are a little early never lead: the states go on with what measures motion.
TEST(Clock, OfGnssIsNeverAheadOfTheOdometers) {
  Train train;
  for (double t = 1; t < 60; ++t) {
    train.run_to(t);
    train.gnss(1.0);
  }
  EXPECT_EQ(train.outside, 0);
  EXPECT_NEAR(train.states, 59 * 50, 5);
  EXPECT_EQ(train.state->stamp_ns, at(59));
  EXPECT_EQ(train.state->reason.find("no wheel"), std::string::npos) << train.state->reason;
}

TEST(Clock, OfAFirstSampleThatIsWildIsLeft) {
  for (const double wild_s : {10.0, 3600.0}) {
    Train by_gnss;
    by_gnss.gnss(wild_s);
    Train by_wheel;
    by_wheel.fusion.add(wheel_at(wild_s, 0));
    for (auto* train : {&by_gnss, &by_wheel}) {
      train->run_to(30);
      EXPECT_EQ(train->outside, 0) << wild_s;
      EXPECT_GT(train->states, 29 * 50) << wild_s;
      EXPECT_NEAR(train->state->distance_m, 600, 3) << wild_s;
    }
  }
}

// Pictures may come slower while a train starts up: then none later is out of a rhythm.
TEST(Clock, IsNotDoubtedForARhythmOfBefore) {
  auto fusion = fusion_at(0);
  for (int i = 1; i <= 20; ++i) fusion.add(step_at(0.1 * i, kSpeedMps, 0.1));
  run(fusion, 2, 10, kSpeedMps);
  const auto state = fusion.add(step_at(10.02, 0));
  ASSERT_TRUE(state);
  EXPECT_NEAR(state->distance_m, kSpeedMps * 10.02, 0.05) << "no train stops within a picture";
}

TEST(Clock, SetForwardIsBridgedByWhatCountsTheWay) {
  for (const bool has_imu : {false, true}) {
    for (const double set_s : {3.0, 60.0, 3600.0, 1.5e9}) {
      Train train(true, has_imu);
      train.run_to(15);
      train.run_to(45, {set_s, set_s, set_s});
      EXPECT_EQ(train.fusion.counts().clock_resets, 1U) << set_s;
      EXPECT_NEAR(train.state->distance_m, 900, 2) << set_s;
      EXPECT_LT(train.state->over_m + train.state->under_m, 100) << set_s;
      EXPECT_EQ(train.outside, 0) << set_s;
    }
  }
}

// The wheel counted on while nothing was heard.
TEST(Clock, ASilenceIsNotTakenForAClockThatWasSet) {
  Train train;
  train.run_to(15);
  Train silent = train;
  silent.run_to(15.0);
  for (double t = 75; t < 95; t += 0.02) {
    silent.state = silent.fusion.add(wheel_at(t, kSpeedMps * t));
    silent.state = silent.fusion.add(step_at(t, kSpeedMps));
  }
  EXPECT_EQ(silent.fusion.counts().clock_resets, 0U);
  EXPECT_NEAR(silent.state->distance_m, 1900, 20);
  EXPECT_LT(std::abs(silent.state->distance_m - 1900), silent.state->over_m);
}

TEST(Clock, SetBackIsFollowedWhateverBeganToMeasureSince) {
  for (const double ahead_s : {0.5, 10.0, 3600.0}) {
    Fusion fusion = fusion_at(0);
    for (double t = 0.02; t < 20; t += 0.02) fusion.add(wheel_at(t + ahead_s, kSpeedMps * t));
    std::optional<TrainEstimate> state;
    int states = 0;
    for (double t = 20; t < 60; t += 0.02) {
      for (const auto& estimate : {fusion.add(wheel_at(t, kSpeedMps * t)), fusion.add(step_at(t, kSpeedMps))}) {
        if (!estimate) continue;
        state = estimate;
        ++states;
      }
    }
    EXPECT_GT(states, 1900) << ahead_s;
    EXPECT_EQ(fusion.counts().clock_resets, 1U) << ahead_s;
    EXPECT_NEAR(state->distance_m, 1200, 12) << ahead_s;
  }
}

// Fusion is started anew at a platform, or the clock is set there: odometry still counts from the picture of before.
TEST(Clock, AReferencePictureOfBeforeIsNoReasonToDoubtAStand) {
  for (const double older_s : {3.5, 60.0, -1000.0}) {
    Fusion fusion = fusion_at(1000);
    std::optional<TrainEstimate> state;
    for (int i = 1; i < 50 * 300; ++i) {
      const double t = 0.02 * i;
      fusion.add(ImuInput{at(t), 0.01 * ((i * 7919) % 13 - 6), 0});
      fusion.add(wheel_at(t, 0));
      if (auto estimate = fusion.add(OdometryInput{at(t), at(-older_s), 0.002 * (i % 2), 0.001, true}))
        state = estimate;
    }
    EXPECT_NEAR(state->position.offset_m, 1000, 0.1) << older_s;
    EXPECT_LT(state->over_m, 6) << older_s;
    EXPECT_EQ(state->reason, kOnlyTold) << older_s;
  }
}

// Pictures take 0.4 s to be measured, and the IMU has begun before them.
TEST(Clock, IsNotSetBackByWhatBeginsLate) {
  Fusion fusion = fusion_at(0);
  std::optional<TrainEstimate> state;
  for (double t = 0.01; t < 30; t += 0.01) {
    if (auto estimate = fusion.add(ImuInput{at(t), 0.001, 0})) state = estimate;
    if (auto estimate = fusion.add(step_at(t - 0.4, 0, 0.01))) state = estimate;
  }
  EXPECT_EQ(fusion.counts().clock_resets, 0U);
  ASSERT_TRUE(state);
  EXPECT_GT(core::seconds(state->stamp_ns - kBeginNs), 29);
  EXPECT_NEAR(state->distance_m, 0, 0.1);
}

// A train brakes while nothing is heard: what the wheel has counted is where it is.
TEST(Clock, ASilenceInWhichTheTrainBrakesIsNotTakenForAClockThatWasSet) {
  for (const auto& [speed_mps, gap_s] : {std::pair(20.0, 30.0), {5.0, 6.0}, {10.0, 14.0}}) {
    Fusion fusion = fusion_at(0);
    double way_m = 0;
    std::optional<TrainEstimate> state;
    const auto hear = [&](double t, double step_m) {
      way_m += step_m;
      fusion.add(wheel_at(t, way_m));
      state = fusion.add(OdometryInput{at(t), at(t - 0.02), step_m, 0.001, true});
      if (!state) return;
      const double error_m = state->distance_m - way_m;
      ASSERT_LT(error_m, state->over_m) << speed_mps << " m/s at " << t;
      ASSERT_LT(-error_m, state->under_m) << speed_mps << " m/s at " << t;
    };
    for (double t = 0.02; t < 20; t += 0.02) hear(t, 0.02 * speed_mps);
    way_m += 0.5 * speed_mps * speed_mps / 1.0;  // to a halt, at 1 m/s^2
    for (double t = 20 + gap_s; t < 60 + gap_s; t += 0.02) hear(t, 0);
    EXPECT_EQ(fusion.counts().clock_resets, 0U) << speed_mps;
    EXPECT_NEAR(state->distance_m, way_m, 3) << speed_mps;
  }
}

TEST(Clock, AStampThatFreezesHoldsNothing) {
  Train train;
  train.run_to(20);
  Fusion fusion = train.fusion;
  const auto resets = fusion.counts().clock_resets;
  std::optional<TrainEstimate> state;
  for (double t = 20.02; t < 40; t += 0.02) {
    fusion.add(ImuInput{at(t), 0.001, 0});
    fusion.add(wheel_at(20, kSpeedMps * t));
    if (auto estimate = fusion.add(step_at(t, kSpeedMps))) state = estimate;
  }
  EXPECT_EQ(fusion.counts().clock_resets, resets);
  EXPECT_NEAR(core::seconds(state->stamp_ns - kBeginNs), 40, 0.03);
  EXPECT_NEAR(state->distance_m, 800, 2);
}

TEST(Clock, GnssAloneBeginsWhenNothingMeasuresMotion) {
  Fusion fusion = fusion_without_start();
  for (int i = 0; i < 30; ++i) fusion.add(GnssInput{at(i), 0, 20.0 * i, 1, 1});
  EXPECT_GT(fusion.counts().used, 20U);
}

// Whoever says "not known" with the largest number there is.
TEST(Clock, NumbersWhoseSquaresRunOverPromiseNothing) {
  const double most = std::numeric_limits<double>::max();
  Fusion fusion = fusion_at(0);
  run(fusion, 0, 5, kSpeedMps);
  fusion.add(OdometryInput{at(5.02), at(5), 0.4, most, true});
  fusion.add(FixInput{at(5.02), 1, 100, most, 1, 1, FixKind::landmark, track::Direction::forward, nullptr});
  fusion.add(ImuInput{at(5.02), most, -most});
  fusion.add(WheelInput{at(5.02), std::numeric_limits<int64_t>::min(), 1});
  EXPECT_EQ(fusion.counts().nonsense, 4U);
  const auto state = run(fusion, 5.02, 10, kSpeedMps);
  EXPECT_GT(state.over_m, 1);
  EXPECT_LT(state.over_m, 50);
}

}  // namespace
}  // namespace railfix::fusion::clock_test
