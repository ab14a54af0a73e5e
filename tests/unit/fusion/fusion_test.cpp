#include "fusion/fusion.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "straight_run.hpp"
#include "support/train/simulation.hpp"

namespace railfix::fusion {
namespace {

using testing::HasSubstr;

TEST(Fusion, CameraAloneGivesPlaceSpeedAndInterval) {
  auto fusion = fusion_at(500);
  const auto state = run(fusion, 0, 20, 10);
  EXPECT_EQ(state.stamp_ns, at(20));
  EXPECT_NEAR(state.distance_m, 200, 0.01);
  EXPECT_NEAR(state.position.offset_m, 700, 0.01);
  EXPECT_NEAR(state.northing_m, 700, 0.01);
  EXPECT_NEAR(state.speed_mps, 10, 0.05);
  EXPECT_TRUE(state.track_known);
  EXPECT_EQ(state.reason, kOnlyTold);
  EXPECT_NEAR(state.since_reference_m, 200, 0.01);
  EXPECT_TRUE(std::isnan(state.lat_deg));
  EXPECT_EQ(state.sources, 1U << static_cast<int>(Source::camera));
  // 1 % of scale must be admitted, and no more than the budget.
  EXPECT_GT(state.over_m, 0.02 * 200);
  EXPECT_LT(state.over_m, 5 + 0.05 * 200);
}

TEST(Fusion, WithoutMapDistanceAndSpeedRun) {
  auto fusion = core::value_or_throw(Fusion::create({}, nullptr, std::nullopt));
  const auto state = run(fusion, 0, 10, -5);
  EXPECT_FALSE(state.track_known);
  EXPECT_EQ(state.position.edge, 0U);
  EXPECT_NEAR(state.distance_m, -50, 0.01);
  EXPECT_NEAR(state.speed_mps, -5, 0.05);
  EXPECT_THAT(state.reason, HasSubstr("place on the map not known"));
}

// The first pictures of a run take long: states at their own time are worth more than one that knows nothing.
TEST(Fusion, WaitsForTheFirstStepsOfALateCamera) {
  auto fusion = fusion_at(500);
  const auto first = fusion.add(ImuInput{at(0), 0, 0});
  ASSERT_TRUE(first);
  for (double t_s = 0.01; t_s < 0.3; t_s += 0.01) {
    fusion.add(ImuInput{at(t_s), 0, 0});
    EXPECT_FALSE(fusion.tick(at(t_s + 0.005))) << t_s;
  }
  for (double t_s = 0.25; t_s < 0.3; t_s += 0.01) EXPECT_TRUE(fusion.add(step_at(t_s, 10, 0.01))) << t_s;
  const auto silent = fusion.tick(at(0.6));
  ASSERT_TRUE(silent);
  EXPECT_LT(silent->over_m + silent->under_m, 15);

  auto blind = fusion_at(500);
  blind.add(ImuInput{at(0), 0, 0});
  const auto alone = blind.tick(at(0.6));
  ASSERT_TRUE(alone);
  EXPECT_EQ(alone->integrity, Integrity::unusable);
}

// Motion alone says nothing of the scale; a filter that linearises badly believes otherwise.
TEST(Fusion, ScaleIsNotLearntWithoutReferences) {
  auto camera = fusion_at(0);
  auto wheel = fusion_at(0);
  core::Random random(4);
  for (int i = 1; i <= 4000; ++i) {
    auto step = step_at(i * 0.1, 25, 0.1);
    step.step_m += 0.001 * random.normal();
    camera.add(step);
    wheel.add(wheel_at(i * 0.1, 25 * i * 0.1));
  }
  EXPECT_NEAR(camera.estimator()->filter().scale(Odometer::camera), 1, 1e-9);
  EXPECT_NEAR(wheel.estimator()->filter().scale(Odometer::wheel), 1, 1e-9);
  EXPECT_NEAR(camera.estimator()->filter().scale_sigma(Odometer::camera), 0.01, 0.0005);
  EXPECT_NEAR(wheel.estimator()->filter().scale_sigma(Odometer::wheel), 0.01, 0.0005);
}

TEST(Fusion, KeyFramesPinAStandingTrain) {
  auto fusion = fusion_at(100);
  fusion.add(OdometryInput{at(0.02), at(0), 0, 0.001, true});
  core::Random random(3);
  std::optional<TrainEstimate> state;
  for (int i = 2; i < 15000; ++i) {
    state = fusion.add(OdometryInput{at(i * 0.02), at(0), 0.001 * random.normal(), 0.001, true});
  }
  ASSERT_TRUE(state);
  EXPECT_NEAR(state->distance_m, 0, 0.005);
  EXPECT_NEAR(state->speed_mps, 0, 0.03);
  EXPECT_TRUE(state->standstill);
}

// Nothing may depend on the order in which measurements arrive.
void expect_the_same_in_any_order(const train::SimulationPlan& plan, uint64_t seed) {
  const train::TrainSimulation simulation(plan, seed);
  auto in_order = core::value_or_throw(Fusion::create({}, simulation.map, simulation.start()));
  auto mixed = core::value_or_throw(Fusion::create({}, simulation.map, simulation.start()));
  in_order.add(simulation.arrivals.front().event);
  mixed.add(simulation.arrivals.front().event);

  std::vector<std::pair<int64_t, Event>> arrivals;
  for (size_t i = 1; i < simulation.arrivals.size(); ++i) {
    const auto& event = simulation.arrivals[i].event;
    in_order.add(event);
    int64_t delay_ns = 0;
    if (std::holds_alternative<OdometryInput>(event)) delay_ns = 80'000'000;
    if (std::holds_alternative<FixInput>(event)) delay_ns = 900'000'000;
    if (std::holds_alternative<GnssInput>(event)) delay_ns = 300'000'000;
    arrivals.emplace_back(stamp_of(event) + delay_ns, event);
  }
  std::stable_sort(arrivals.begin(), arrivals.end(), [](const auto& a, const auto& b) { return a.first < b.first; });
  for (const auto& [when, event] : arrivals) mixed.add(event);

  EXPECT_EQ(mixed.counts().too_late, 0U);
  EXPECT_EQ(*in_order.latest_stamp_ns(), *mixed.latest_stamp_ns());
  const auto& a = in_order.estimator()->filter();
  const auto& b = mixed.estimator()->filter();
  EXPECT_NEAR(a.path_distance_m(), b.path_distance_m(), 1e-6) << "seed " << seed;
  EXPECT_NEAR(a.path_sigma_m(), b.path_sigma_m(), 1e-6);
  EXPECT_NEAR(a.scale(Odometer::camera), b.scale(Odometer::camera), 1e-9);
}

TEST(Fusion, LateMeasurementsAreUsedAtTheirOwnTime) {
  train::SimulationPlan plan;
  plan.duration_s = 40;
  expect_the_same_in_any_order(plan, 5);
}

// What the wheel said before its slip was found is taken back from a moment on that follows from the data alone.
TEST(Fusion, SlipsAreTakenBackAlikeInAnyOrder) {
  train::SimulationPlan plan;
  plan.duration_s = 120;
  plan.gnss = false;
  for (uint64_t seed = 1; seed <= 8; ++seed) expect_the_same_in_any_order(plan, seed);
}

// A sensor that was away delivers what it has kept at once: the same state, and the time is replayed once.
TEST(Fusion, ManyLateMeasurementsInARowAreUsedAtTheirOwnTimeToo) {
  Fusion in_order = fusion_at(100);
  Fusion burst = fusion_at(100);
  std::vector<Event> kept;
  for (int i = 1; i <= 400; ++i) {
    const double t_s = i * 0.02;
    const Event wheel = wheel_at(t_s, 10 * t_s);
    in_order.add(wheel);
    const bool away = i > 300 && i <= 350;
    if (away) kept.push_back(wheel);
    if (!away) {
      for (const auto& late : kept) EXPECT_FALSE(burst.add(late));
      kept.clear();
    }
    if (!away) burst.add(wheel);
    if (i % 5 != 0) continue;
    const auto expected = in_order.add(step_at(t_s, 10, 0.1));
    const auto state = burst.add(step_at(t_s, 10, 0.1));
    ASSERT_TRUE(expected && state) << t_s;
    if (t_s < 7.1) continue;
    EXPECT_NEAR(state->distance_m, expected->distance_m, 1e-9);
    EXPECT_NEAR(state->over_m, expected->over_m, 1e-9);
  }
  EXPECT_EQ(burst.counts().too_late, 0U);
}

// Every picture is used and answered at once, however many came before it and whatever else the history holds.
TEST(Fusion, EveryOdometryStepGivesAState) {
  for (const bool inertial : {false, true}) {
    auto fusion = fusion_at(100);
    double way_m = 0;
    double reference_m = 0;
    double reference_s = 0;
    for (int i = 0; i < 2000; ++i) {
      const double t_s = i / 30.0;
      way_m = t_s < 2 ? 0 : 0.5 * 0.4 * (t_s - 2) * (t_s - 2);
      if (inertial) fusion.add(ImuInput{at(t_s - 0.01), t_s < 2 ? 0 : 0.4, 0});
      const auto state = fusion.add(OdometryInput{at(t_s), at(reference_s), way_m - reference_m, 0.001, i >= 2});
      ASSERT_TRUE(state) << "picture " << i;
      EXPECT_EQ(state->stamp_ns, at(t_s));
      EXPECT_EQ(fusion.estimator()->watch(Source::camera).seen_ns, at(t_s));
      EXPECT_NEAR(state->distance_m, way_m, 0.02) << "picture " << i;
      if (way_m - reference_m > 0.4) {  // key frame: many pictures when slow, one when fast
        reference_m = way_m;
        reference_s = t_s;
      }
    }
  }
}

TEST(Fusion, StampsOfStatesOnlyGrow) {
  auto fusion = fusion_at(0);
  fusion.add(step_at(0.02, 10));
  fusion.add(step_at(0.06, 10, 0.04));
  EXPECT_FALSE(fusion.add(step_at(0.04, 10)));  // late: used, but the state was given already
  EXPECT_EQ(fusion.counts().used, 3U);
  EXPECT_FALSE(fusion.add(step_at(0.04, 10)));
  EXPECT_EQ(fusion.counts().repeated, 1U);
}

TEST(Fusion, BlindCameraIsBridgedByTheWheel) {
  auto fusion = fusion_at(0);
  std::optional<TrainEstimate> state;
  for (int i = 1; i <= 1500; ++i) {
    const double t = i * 0.02;
    fusion.add(wheel_at(t, 10 * t));
    auto step = step_at(t, 10);
    if (t > 10) step = {at(t), at(t - 0.02), 0, 0, false};
    if (const auto s = fusion.add(step)) state = s;
  }
  ASSERT_TRUE(state);
  EXPECT_NEAR(state->distance_m, 300, 0.3);
  EXPECT_THAT(state->reason, HasSubstr("camera blind"));
  EXPECT_EQ(state->integrity, Integrity::degraded);
  EXPECT_LT(state->over_m, 5 + 0.05 * 300);
}

TEST(Fusion, WheelAloneGivesStatesTenTimesASecond) {
  auto fusion = fusion_at(0);
  int states = 0;
  std::optional<TrainEstimate> last;
  for (int i = 0; i <= 500; ++i) {
    if (const auto s = fusion.add(wheel_at(i * 0.02, 8 * i * 0.02))) {
      ++states;
      last = s;
    }
  }
  EXPECT_GE(states, 99);
  ASSERT_TRUE(last);
  EXPECT_NEAR(last->distance_m, 8 * core::seconds(last->stamp_ns - kBeginNs), 0.1);
  EXPECT_NEAR(last->speed_mps, 8, 0.1);
}

TEST(Fusion, SlippingWheelIsIsolatedAndTakenBackLater) {
  auto fusion = fusion_at(0);
  double wheel_m = 0;
  bool isolated = false;
  std::optional<TrainEstimate> state;
  for (int i = 1; i <= 3000; ++i) {
    const double t = i * 0.02;
    const bool slip = t > 20 && t < 26;
    wheel_m += 0.2 * (slip ? 1.06 : 1.0);
    if (const auto s = fusion.add(step_at(t, 10))) state = s;
    fusion.add(wheel_at(t, wheel_m));
    if (state->reason.find("wheel slips") != std::string::npos) {
      isolated = true;
      EXPECT_GT(t, 20);
      EXPECT_LT(t, 30);
    }
  }
  EXPECT_TRUE(isolated);
  EXPECT_EQ(state->reason, kOnlyTold);
  EXPECT_NEAR(state->distance_m, 600, 0.15);
  EXPECT_NEAR(state->visual_scale, 1, 1e-3);
  EXPECT_NEAR(state->wheel_scale, 1, 1e-3);
}

TEST(Fusion, WithoutAnySensorTheIntervalGrowsAndSaysSo) {
  auto fusion = fusion_at(0);
  const auto before = run(fusion, 0, 10, 20);
  double over_m = before.over_m;
  std::optional<TrainEstimate> state;
  for (int i = 1; i <= 100; ++i) {
    state = fusion.tick(at(10 + 0.1 * i));
    ASSERT_TRUE(state);
    EXPECT_GT(state->over_m, over_m);
    over_m = state->over_m;
  }
  EXPECT_NEAR(state->distance_m, 400, 5);
  EXPECT_EQ(state->integrity, Integrity::unusable);
  EXPECT_THAT(state->reason, HasSubstr("no camera"));
  EXPECT_FALSE(fusion.tick(at(20)));  // no second state for one time
}

/// A switch at 1000 m: edge 2 straight on, edge 3 to the left.
Fusion fusion_on_fork(const track::EdgePosition& start) {
  auto map = std::make_shared<track::Map>();
  map->edges.push_back({1, "stem", 1, 2, "", track::Alignment::chained({0, 0, 0}, {{1000, 0, 0}})});
  map->edges.push_back({2, "straight", 2, 3, "", track::Alignment::chained({0, 1000, 0}, {{1000, 0, 0}})});
  map->edges.push_back({3, "left", 2, 4, "", track::Alignment::chained({0, 1000, 0}, {{1000, 0.001, 0.001}})});
  map->connections = {{2, 1, 2, false}, {2, 1, 3, true}};
  return core::value_or_throw(Fusion::create({}, map, start));
}

TEST(Fusion, FollowsTheDeclaredTrackAndSaysWhileItIsOpen) {
  auto fusion = fusion_on_fork({1, 900, track::Direction::forward});
  EXPECT_EQ(run(fusion, 0, 9, 10).track_probability, 1);
  const auto said = [&](double t_s, uint32_t edge, double offset_m, double probability) {
    FixInput fix{at(t_s), edge, offset_m, INFINITY, probability, 0, FixKind::track, track::Direction::forward, nullptr};
    fusion.add(fix);
  };
  auto state = run(fusion, 9, 12, 10);
  EXPECT_EQ(state.position.edge, 2U);
  EXPECT_EQ(state.track_probability, 0.5);  // nobody has looked yet
  said(12, 3, 20, 0.8);
  state = run(fusion, 12, 13, 10);
  EXPECT_EQ(state.position.edge, 2U);
  EXPECT_NEAR(state.track_probability, 0.2, 1e-9);  // the other track is the likelier
  said(13, 3, 30, 0.9995);
  state = run(fusion, 13, 14, 10);
  EXPECT_EQ(state.position.edge, 3U);
  EXPECT_NEAR(state.position.offset_m, 40, 0.1);
  EXPECT_EQ(state.track_probability, 0.9995);
  EXPECT_NEAR(state.distance_m, 140, 0.1);
  EXPECT_LT(state.over_m, 10);
}

// A picture that comes late asks for the moment before the track was declared.
TEST(Fusion, AStateOfTheTimeBeforeATrackWasDeclaredLiesOnThePathOfThatTime) {
  auto fusion = fusion_on_fork({1, 900, track::Direction::forward});
  run(fusion, 0, 12, 10);
  fusion.add(FixInput{at(12.01), 3, 20, INFINITY, 0.9995, 0, FixKind::track, track::Direction::forward, nullptr});
  const auto before = fusion.add(step_at(12.005, 10, 0.005));
  ASSERT_TRUE(before && before->path);
  EXPECT_EQ(before->position.edge, 2U);
  EXPECT_EQ(before->path->position_at(before->path_distance_m).edge, 2U);
  const auto after = fusion.add(step_at(12.025, 10, 0.02));
  ASSERT_TRUE(after && after->path);
  EXPECT_EQ(after->path->position_at(after->path_distance_m).edge, 3U);
  auto lost = fusion_without_start();
  EXPECT_EQ(run(lost, 0, 1, 10).path, nullptr);
}

// As a matcher would say that has lost the train.
TEST(Fusion, ATrackThatIsNotBesideTheTrainIsNotBelieved) {
  auto map = std::make_shared<track::Map>();
  map->edges.push_back({1, "first", 1, 2, "", track::Alignment::chained({0, 0, 0}, {{3000, 0, 0}})});
  map->edges.push_back({2, "second", 2, 3, "", track::Alignment::chained({0, 3000, 0}, {{3000, 0, 0}})});
  map->edges.push_back({3, "left", 2, 4, "", track::Alignment::chained({0, 3000, 0}, {{3000, 0.001, 0.001}})});
  map->edges.push_back({4, "of another line", 5, 6, "", track::Alignment::chained({30, 0, 0}, {{6000, 0, 0}})});
  map->connections = {{2, 1, 2, false}, {2, 1, 3, true}};
  auto fusion = core::value_or_throw(Fusion::create({}, map, track::EdgePosition{2, 1000, track::Direction::forward}));
  run(fusion, 0, 10, 20);
  const auto forward = track::Direction::forward;
  for (const auto& place : {track::EdgePosition{2, 100, forward}, track::EdgePosition{1, 1200, forward},
                            track::EdgePosition{3, 100, forward}, track::EdgePosition{4, 4200, forward},
                            track::EdgePosition{9, 0, forward}}) {
    fusion.add(FixInput{at(10), place.edge, place.offset_m, INFINITY, 1.0, 0, FixKind::track, forward, nullptr});
  }
  EXPECT_EQ(fusion.counts().elsewhere, 5U);
  const auto state = run(fusion, 10, 12, 20);
  EXPECT_EQ(state.position.edge, 2U);
  EXPECT_NEAR(state.position.offset_m, 1240, 0.2);
  EXPECT_EQ(state.track_probability, 1);
  // The track beside it is another matter.
  fusion.add(FixInput{at(12), 3, 1238, INFINITY, 1.0, 0, FixKind::track, forward, nullptr});
  EXPECT_EQ(fusion.counts().elsewhere, 5U);
  EXPECT_EQ(run(fusion, 12, 13, 20).position.edge, 3U);
}

TEST(Fusion, WithoutAMatcherTheTrackBehindASwitchIsAGuessAndOnTheStemItIsNot) {
  auto there = fusion_on_fork({1, 950, track::Direction::forward});
  EXPECT_EQ(run(there, 0, 4, 10).track_probability, 1);
  EXPECT_EQ(run(there, 4, 20, 10).track_probability, 0.5);  // 150 m behind it
  for (int t = 20; t < 40; ++t) run(there, t, t + 1, 30 - t);
  EXPECT_EQ(run(there, 40, 60, -10).track_probability, 1);  // back before it
  for (int t = 60; t < 80; ++t) run(there, t, t + 1, t - 70);
  EXPECT_EQ(run(there, 80, 95, 10).track_probability, 0.5);  // it may have been thrown
  // A leg that is run towards the switch is no question.
  auto trailing = fusion_on_fork({3, 100, track::Direction::reverse});
  const auto state = run(trailing, 0, 20, 10);
  EXPECT_EQ(state.position.edge, 1U);
  EXPECT_EQ(state.track_probability, 1);
}

TEST(Fusion, GnssHoldsTheIntervalAndWildFixesAreRefused) {
  auto fusion = fusion_at(0);
  std::optional<TrainEstimate> state;
  for (int i = 1; i <= 30000; ++i) {
    const double t = i * 0.02;
    if (const auto s = fusion.add(step_at(t, 9.9))) state = s;  // 1 % short
    if (i % 50 == 0) fusion.add(GnssInput{at(t + 0.001), 1.5, 10 * t + (i % 1000 == 0 ? 90 : 0.5), 1.0, 1});
  }
  EXPECT_NEAR(state->position.offset_m, 6000, 5);  // the camera alone would be 60 m off
  EXPECT_LT(state->over_m, 75);                    // by 5 % of the way it would be 300
  EXPECT_GT(state->over_m, std::abs(state->position.offset_m - 6000));
}

// A minute at a station: GNSS wanders, so does the place, and the train stands.
TEST(Fusion, GnssMovesThePlaceOfAStandingTrainAndNotTheTrain) {
  for (const bool with_camera : {false, true}) {
    auto fusion = fusion_at(0);
    std::optional<TrainEstimate> state;
    double least_m = INFINITY;
    double most_m = -INFINITY;
    for (int i = 1; i <= 6000; ++i) {
      const double t = i * 0.02;
      const double brakes_s = std::clamp(t - 40, 0.0, 10.0);
      const double place_m = 8 * std::min(t, 50.0) - 0.4 * brakes_s * brakes_s;
      if (auto s = fusion.add(wheel_at(t, 1.01 * place_m))) state = s;
      if (with_camera) state = fusion.add(step_at(t, 8 - 0.8 * brakes_s));
      if (i % 50 == 0) fusion.add(GnssInput{at(t + 0.001), 0, place_m + 3 * std::sin(0.1 * t), 1.0, 1});
      if (t < 53) continue;
      ASSERT_TRUE(state && state->standstill) << t << " s";
      least_m = std::min(least_m, state->distance_m);
      most_m = std::max(most_m, state->distance_m);
    }
    if (!with_camera) {
      EXPECT_GT(most_m - least_m, 0.3) << "it was moved";
    }
    double t = 120;
    while (state->standstill && t < 125) {  // and says so when it starts again
      t += 0.02;
      if (auto s = fusion.add(wheel_at(t, 1.01 * (360 + 0.25 * (t - 120) * (t - 120))))) state = s;
      if (with_camera) state = fusion.add(step_at(t, 0.5 * (t - 120)));
    }
    EXPECT_LT(t, 122);
  }
}

TEST(Fusion, WildStampsAreNotFollowedButANewClockIs) {
  auto fusion = fusion_at(0);
  run(fusion, 0, 5, 10);
  EXPECT_FALSE(fusion.add(wheel_at(3600, 1e6)));
  EXPECT_EQ(fusion.counts().jumped, 1U);
  EXPECT_EQ(*fusion.latest_stamp_ns(), at(5));

  auto state = run(fusion, -100, -90, 10);  // set back by 105 s
  EXPECT_EQ(fusion.counts().clock_resets, 1U);
  EXPECT_EQ(state.stamp_ns, at(-90));
  EXPECT_NEAR(state.distance_m, 50 + 100, 1);  // no step is lost until the new clock is believed

  state = run(fusion, 1000, 1010, 10);  // set forward: what happened in between is not known
  EXPECT_EQ(state.stamp_ns, at(1010));
  EXPECT_GT(state.over_m, 1000);
}

TEST(Fusion, NonsenseNumbersAreRefused) {
  auto fusion = fusion_at(0);
  run(fusion, 0, 5, 10);
  const double nan = std::numeric_limits<double>::quiet_NaN();
  fusion.add(OdometryInput{at(5.02), at(5), nan, 0.001, true});
  fusion.add(OdometryInput{at(5.04), at(5.02), 0.2, nan, true});
  fusion.add(OdometryInput{at(5.06), at(5.07), 0.2, 0.001, true});  // counts from the future
  fusion.add(WheelInput{at(5.06), 3, 0});
  fusion.add(ImuInput{at(5.06), nan, nan});
  fusion.add(ImuInput{at(5.2), nan, nan});
  fusion.add(GnssInput{at(5.06), nan, nan, nan, 1});
  fusion.add(FixInput{at(5.06), 1, nan, 0.1, 1, 1, FixKind::landmark, track::Direction::forward, nullptr});
  fusion.add(FixInput{at(5.06), 1, 50, nan, 1, 2, FixKind::landmark, track::Direction::forward, nullptr});
  const auto state = run(fusion, 5.2, 6, 10);
  EXPECT_NEAR(state.distance_m, 60, 0.5);
  EXPECT_TRUE(std::isfinite(state.over_m));
}

TEST(Fusion, StartMustBeOnTheMap) {
  const auto fusion = Fusion::create({}, straight_line(), track::EdgePosition{9, 0, track::Direction::forward});
  ASSERT_FALSE(fusion.ok());
  EXPECT_THAT(fusion.error().message, HasSubstr("edge 9"));
}

}  // namespace
}  // namespace railfix::fusion
