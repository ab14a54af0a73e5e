#include "fusion/camera_lag.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>

#include "core/random.hpp"
#include "core/time.hpp"
#include "fusion/lag_room.hpp"
#include "support/train/verdict.hpp"

namespace railfix::fusion {
namespace {

constexpr double kPulsesPerMetre = 90;
constexpr double kSampleS = 0.05;

/// Way run until then, m.
using Way = std::function<double(double t_s)>;

/// From rest at 0.7 m/s2 to 21 m/s, which are kept.
double departure(double t_s) {
  const double until_s = std::min(t_s, 30.0);
  return 0.35 * until_s * until_s + 21 * (t_s - until_s);
}

/// The camera's stamps are `lag_s` late; the wheel counts what `wheel` says.
CameraLag::Lag measured(double lag_s, double duration_s, const Way& way, const Way& wheel) {
  CameraLag watch;
  core::Random random(1);
  double seen_m = way(-lag_s);
  for (double t = kSampleS; t < duration_s; t += kSampleS) {
    const int64_t now_ns = core::to_ns(1000 + t);
    watch.add(WheelInput{now_ns, static_cast<int64_t>(std::floor(wheel(t) * kPulsesPerMetre)), kPulsesPerMetre});
    const double way_m = way(t - lag_s);
    const double step_m = 1.004 * (way_m - std::exchange(seen_m, way_m)) + 0.002 * random.normal();
    watch.add(OdometryInput{now_ns, now_ns - core::to_ns(kSampleS), step_m, 0.002, true});
  }
  return watch.lag().value();
}

double from_rest(double t_s) {
  return t_s < 0 ? 0 : departure(t_s);
}

TEST(CameraLag, IsKnownSoonAfterTheDeparture) {
  for (const double lag_s : {-0.1, 0.0, 0.03, 0.3}) {
    const auto lag = measured(lag_s, 15, from_rest, from_rest);
    EXPECT_NEAR(lag.late_s, lag_s, 0.01) << lag_s;
    EXPECT_LT(lag.sigma_s, 0.02) << lag_s;
  }
}

TEST(CameraLag, ThatIsLongerThanUsualIsKnownLater) {
  for (const double lag_s : {-0.8, 0.6, 0.8, 1.2}) {
    const auto lag = measured(lag_s, 29, from_rest, from_rest);
    EXPECT_NEAR(lag.late_s, lag_s, 0.03) << lag_s;
    EXPECT_LT(lag.sigma_s, 0.05) << lag_s;
  }
}

TEST(CameraLag, DoesNotShowAtConstantSpeed) {
  const Way even = [](double t_s) { return 30 * t_s; };
  EXPECT_GT(measured(0.1, 120, even, even).sigma_s, 0.1);
}

// At constant speed a clock that runs away is a ratio and nothing else.
TEST(CameraLag, OfClocksThatRunApartIsLessAndLessKnown) {
  constexpr double kApart = 1e-4;
  CameraLag watch;
  int64_t before_ns = 0;
  for (double t = 0; t < 900; t += kSampleS) {
    const int64_t now_ns = core::to_ns(1000 + t);
    watch.add(WheelInput{now_ns, static_cast<int64_t>(std::floor(from_rest(t) * kPulsesPerMetre)), kPulsesPerMetre});
    const int64_t stamp_ns = now_ns + core::to_ns(kApart * t);
    const double step_m = from_rest(t) - from_rest(t - kSampleS);
    if (t > 0) watch.add(OdometryInput{stamp_ns, before_ns, step_m, 0.002, true});
    before_ns = stamp_ns;
    if (t < 60) continue;
    const auto lag = watch.lag().value();
    ASSERT_LT(std::abs(kApart * t - lag.late_s), 2 * lag.sigma_s) << t;
  }
}

TEST(CameraLag, AWheelThatCreepsUnderTractionIsNoLag) {
  const Way creeping = [](double t_s) {
    return t_s < 30 ? 1.01 * from_rest(t_s) : 1.01 * from_rest(30) + 21 * (t_s - 30);
  };
  EXPECT_LT(std::abs(measured(0, 40, from_rest, creeping).late_s), 0.02);
}

TEST(CameraLag, AWheelThatSlipsIsNoLag) {
  const Way slipping = [](double t_s) { return from_rest(t_s) + 2.0 * std::clamp(t_s - 12, 0.0, 5.0); };
  EXPECT_LT(std::abs(measured(0, 60, from_rest, slipping).late_s), 0.02);
}

TEST(CameraLag, AWheelThatIsStuckTellsNothing) {
  const auto lag = measured(0.1, 60, from_rest, [](double) { return 5.0; });
  EXPECT_GT(lag.sigma_s, 0.02);
}

/// At 20 m/s, behind a departure from rest that has shown the lag to be 0. `picture` says what is sent of the one taken
/// then.
using Sent = std::function<std::optional<OdometryInput>(double t_s, OdometryInput)>;
CameraLag::Lag measured_on_the_way(const Sent& sent) {
  CameraLag watch;
  for (double t = kSampleS; t < 60; t += kSampleS) {
    const int64_t now_ns = core::to_ns(1000 + t);
    watch.add(WheelInput{now_ns, static_cast<int64_t>(std::floor(from_rest(t) * kPulsesPerMetre)), kPulsesPerMetre});
    const OdometryInput step{now_ns, now_ns - core::to_ns(kSampleS), from_rest(t) - from_rest(t - kSampleS), 0.002,
                             true};
    if (const auto as_sent = sent(t, step)) watch.add(*as_sent);
  }
  return watch.lag().value();
}

constexpr double kJumpsAtS = 45.01;  // at constant speed

OdometryInput jumped(double t_s, OdometryInput step, double jump_s) {
  if (t_s >= kJumpsAtS) step.stamp_ns += core::to_ns(jump_s);
  if (t_s - kSampleS >= kJumpsAtS) step.reference_stamp_ns += core::to_ns(jump_s);
  return step;
}

TEST(CameraLag, ThatChangesOnTheWayIsKnownAtOnce) {
  for (const double jump_s : {-0.25, -0.04, 0.03, 0.05, 0.2}) {
    const auto lag = measured_on_the_way([&](double t, const OdometryInput& step) { return jumped(t, step, jump_s); });
    EXPECT_NEAR(lag.late_s, jump_s, 0.01) << jump_s;
    EXPECT_LT(lag.sigma_s, 0.06) << jump_s;
  }
}

TEST(CameraLag, ThatMayHaveChangedInASilenceIsNoLongerKnown) {
  const auto lag = measured_on_the_way([](double t, const OdometryInput& step) {
    return t >= kJumpsAtS && t < kJumpsAtS + 3 ? std::nullopt : std::optional(jumped(t, step, 0.2));
  });
  EXPECT_GT(lag.late_s + 2 * lag.sigma_s, 0.2);
}

TEST(CameraLag, ThatMayHaveChangedUnseenIsNoLongerKnown) {
  const auto lag = measured_on_the_way([](double t, const OdometryInput& step) {
    OdometryInput sent = jumped(t, step, 0.13);
    sent.valid = t < kJumpsAtS - 2 || t > kJumpsAtS + 2;
    return std::optional(sent);
  });
  EXPECT_GT(lag.late_s + 2 * lag.sigma_s, 0.13);
}

TEST(CameraLag, PicturesThatAreLeftOutOrWrongAreNoChange) {
  const auto left_out = measured_on_the_way([last = OdometryInput{}](double t, OdometryInput step) mutable {
    const bool is_left_out = std::fmod(t, 1.0) < 0.04;
    if (last.stamp_ns != 0) {  // counts from the last one that was sent
      step.step_m += last.step_m;
      step.reference_stamp_ns = last.reference_stamp_ns;
    }
    last = is_left_out ? step : OdometryInput{};
    return is_left_out ? std::nullopt : std::optional(step);
  });
  EXPECT_NEAR(left_out.late_s, 0, 0.01);
  const auto all_sent = measured_on_the_way([](double, const OdometryInput& step) { return std::optional(step); });
  EXPECT_LT(left_out.sigma_s, 1.1 * all_sent.sigma_s);
  const auto wrong = measured_on_the_way([](double t, OdometryInput step) {
    if (std::fmod(t, 3.0) < 0.04) step.step_m += 0.6;
    return std::optional(step);
  });
  EXPECT_NEAR(wrong.late_s, 0, 0.02);
  EXPECT_LT(wrong.sigma_s, 0.02);
}

train::SimulationPlan late_by(double lag_s) {
  train::SimulationPlan plan = train::campaign_plan();
  plan.duration_s = 100;
  plan.fault = {train::Sensor::camera, train::FaultKind::lag, 0, 0, lag_s};
  return plan;
}

TEST(CameraLag, IsSaidAndHeldByTheInterval) {
  const train::TrainSimulation simulation(late_by(0.2), 4);
  auto fusion = core::value_or_throw(Fusion::create({}, simulation.map, simulation.start()));
  int said = 0;
  const auto verdict = train::judge(simulation, fusion, 0, [&](const TrainEstimate& state, double) {
    said += state.reason.find("camera stamps 0.2") != std::string::npos ? 1 : 0;
  });
  EXPECT_EQ(verdict.outside, 0U);
  EXPECT_GT(said, 1000);
}

/// A ride that begins at speed.
train::TrainSimulation begun_at_speed(const train::SimulationPlan& plan, uint64_t seed = 1) {
  for (;; ++seed)
    if (train::TrainSimulation ride(plan, seed); ride.drive().at(0).speed_mps > 15) return ride;
}

TEST(CameraLag, IsHeldUntilTheSpeedHasShownIt) {
  const auto ride = begun_at_speed(late_by(0.2));
  auto fusion = core::value_or_throw(Fusion::create({}, ride.map, ride.start()));
  EXPECT_EQ(train::judge(ride, fusion).outside, 0U);
}

// The first stamps are the wheel's: before a camera was heard such rides were outside by up to 4 m. As far as the
// allowed width has room.
TEST(CameraLag, OfAWheelIsHeldFromTheFirstStampOn) {
  for (const double lag_s : {0.2, -0.1, -0.17}) {
    auto plan = train::campaign_plan();
    plan.duration_s = 5;
    plan.fault = {train::Sensor::wheel, train::FaultKind::lag, 0, 0, lag_s};
    for (const bool told : {true, false}) {
      plan.start_told = told;
      for (const uint64_t seed : {10, 20, 30, 40, 50}) {
        const auto ride = begun_at_speed(plan, seed);
        auto fusion = core::value_or_throw(Fusion::create({}, ride.map, ride.start()));
        EXPECT_EQ(train::judge(ride, fusion).outside, 0U) << lag_s << ", " << seed;
      }
    }
  }
}

// Landmarks every 50 m leave little room: 12 of 30 such rides with early stamps were outside and ok before these were
// held, and of the late ones those of which the camera went blind, or that began fastest.
TEST(CameraLag, IsHeldBesideManyLandmarks) {
  for (const double lag_s : {0.27, 0.15, -0.15, -0.25}) {
    auto plan = late_by(lag_s);
    plan.sightings = true;
    plan.landmark_spacing_m = 0;
    for (const uint64_t seed : {10, 20, 30}) {
      const auto ride = begun_at_speed(plan, seed);
      auto fusion = core::value_or_throw(Fusion::create({}, ride.map, ride.start()));
      EXPECT_EQ(train::judge(ride, fusion).outside, 0U) << lag_s << ", " << seed;
    }
  }
}

// Of 28 such rides 10 were outside and ok before a jump was looked for.
TEST(CameraLag, ThatChangesOnTheWayIsHeld) {
  for (const double jump_s : {-0.2, 0.1, 0.25}) {
    auto plan = train::campaign_plan();
    plan.fault = {train::Sensor::camera, train::FaultKind::stamp_jump, 100, 0, jump_s};
    for (const uint64_t seed : {1, 2, 3}) {
      const train::TrainSimulation ride(plan, seed);
      auto fusion = core::value_or_throw(Fusion::create({}, ride.map, ride.start()));
      EXPECT_EQ(train::judge(ride, fusion).outside, 0U) << jump_s << ", " << seed;
    }
  }
}

TEST(CameraLag, OfAnEarlierTripIsForgottenWhereItIsAnotherNow) {
  const auto ride = begun_at_speed(late_by(0.2));
  SavedScales saved{{.camera_sigma = 0.01, .wheel_sigma = 0.01}, ride.stamp_ns(0), "", 0, CameraLag::Lag{0.001, 0.004}};
  auto fusion = core::value_or_throw(Fusion::create({}, ride.map, ride.start(), saved));
  EXPECT_NEAR(fusion.camera_lag().value().late_s, 0.001, 1e-9);
  bool said = false;
  train::judge(ride, fusion, 0, [&](const TrainEstimate& state, double) {
    said = said || state.reason.find("camera stamps 0.2") != std::string::npos;
  });
  EXPECT_TRUE(said);
  EXPECT_FALSE(fusion.camera_lag());  // nothing to be kept for the next trip
  fusion = core::value_or_throw(Fusion::create({.camera_lag_s = 0.0005}, ride.map, ride.start(), saved));
  EXPECT_FALSE(fusion.camera_lag());
}

TEST(CameraLag, OfAnEarlierTripIsKnownFromTheStart) {
  const auto ride = begun_at_speed(late_by(0));
  const auto first_under_m = [&](const std::optional<SavedScales>& saved) {
    auto fusion = core::value_or_throw(Fusion::create({}, ride.map, ride.start(), saved));
    std::optional<double> first_m;
    train::judge(ride, fusion, 0, [&](const TrainEstimate& state, double) {
      if (!first_m && core::seconds(state.stamp_ns - ride.stamp_ns(0)) > 2) first_m = state.under_m;
    });
    return first_m.value();
  };
  SavedScales saved{{.camera_sigma = 0.01, .wheel_sigma = 0.01}, ride.stamp_ns(0), "", 0, {}};
  const double unknown_m = first_under_m(saved);
  saved.camera_lag = CameraLag::Lag{0.001, 0.003};
  EXPECT_GT(unknown_m, first_under_m(saved) + 0.5);
}

/// Departs, passes a sure place at 21 m/s, 33 s behind the start, and brakes to a halt from 35 to 56 s.
double to_a_halt(double t_s) {
  const double braked_s = std::clamp(t_s - 35, 0.0, 21.0);
  return from_rest(std::min(t_s, 35.0)) + 21 * braked_s - 0.5 * braked_s * braked_s;
}

// The landmark put the train back by the lag's way at 21 m/s, and the wheel may have carried that on.
TEST(LagRoom, KeepsTheSpeedOfTheSurePlaceAtAHalt) {
  constexpr double kLagS = 0.2;
  constexpr double kBareM = 1;
  const FusionParameters parameters;
  LagRoom room;
  core::Random random(2);
  TrainEstimate state;
  double last_m = 0;
  for (double t = kSampleS; t < 70; t += kSampleS) {
    const int64_t now_ns = core::to_ns(1000 + t);
    room.add(WheelInput{now_ns, static_cast<int64_t>(std::floor(to_a_halt(t) * kPulsesPerMetre)), kPulsesPerMetre});
    const double step_m = to_a_halt(t - kLagS) - to_a_halt(t - kLagS - kSampleS);
    room.add(OdometryInput{now_ns, now_ns - core::to_ns(kSampleS), step_m, 0.002, true});
    state = TrainEstimate();
    state.integrity = Integrity::ok;
    state.stamp_ns = now_ns;
    state.distance_m = to_a_halt(t) + 1e-4 * random.normal();
    state.speed_mps = (state.distance_m - std::exchange(last_m, state.distance_m)) / kSampleS;
    state.since_sure_m = t < 33 ? 1000 + state.distance_m : state.distance_m - to_a_halt(33);
    state.over_m = state.under_m = kBareM;
    room.widen(state, parameters);
  }
  EXPECT_GT(state.under_m, kBareM + kLagS * 20);
}

}  // namespace
}  // namespace railfix::fusion
