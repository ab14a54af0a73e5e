// Does the promised interval hold the truth, over many random runs and every set of sensors?
#include <gtest/gtest.h>

#include <iostream>

#include "core/time.hpp"
#include "support/train/verdict.hpp"

namespace railfix::fusion {
namespace {

using train::FaultKind;
using train::Sensor;
using train::SimulationPlan;

constexpr double kEarlierS = 15;  // faults begin after 25 s

struct Campaign {
  train::Verdict sum;
  double p95_m = 0;
  double budget_share = 0;
};

Campaign run_campaign(const SimulationPlan& plan, int runs, double after_m = 0) {
  Campaign campaign;
  auto& sum = campaign.sum;
  for (int seed = 1; seed <= runs; ++seed) {
    const train::TrainSimulation simulation(plan, static_cast<uint64_t>(seed));
    auto fusion = core::value_or_throw(Fusion::create({}, simulation.map, simulation.start()));
    const auto verdict = train::judge(simulation, fusion, after_m);
    EXPECT_GT(verdict.states, 0U);
    if (verdict.outside > 0)
      std::cout << "seed " << seed << ": " << verdict.outside << " of " << verdict.states << " outside, by up to "
                << verdict.worst_excess_m << " m\n";
    sum.add(verdict);
  }
  campaign.p95_m = train::quantile(sum.errors_m, 0.95);
  campaign.budget_share = 1 - static_cast<double>(sum.wider) / static_cast<double>(sum.states);
  std::cout << sum.states << " states, " << sum.outside << " outside, p50 " << train::quantile(sum.errors_m, 0.5)
            << " m, p95 " << campaign.p95_m << " m, max " << train::quantile(sum.errors_m, 1) << " m, within budget "
            << campaign.budget_share << ", mean interval " << sum.width_sum_m / static_cast<double>(sum.states)
            << " m\n";
  EXPECT_EQ(sum.wider_unsaid, 0U);
  return campaign;
}

TEST(Coverage, AllSensorsWithLandmarksEvery400m) {
  const auto campaign = run_campaign({}, 12, 1250);  // behind the third landmark: scales are known
  EXPECT_EQ(campaign.sum.outside, 0U);
  EXPECT_LE(campaign.p95_m, 0.5);
  EXPECT_GE(campaign.budget_share, 0.99);
}

TEST(Coverage, CameraAloneWithLandmarks) {
  SimulationPlan plan;
  plan.wheel = plan.imu = plan.gnss = plan.blind_spells = false;
  const auto campaign = run_campaign(plan, 15, 1250);
  EXPECT_EQ(campaign.sum.outside, 0U);
  EXPECT_LE(campaign.p95_m, 0.8);
}

TEST(Coverage, CameraAloneWithoutLandmarksDriftsInsideItsInterval) {
  SimulationPlan plan;
  plan.wheel = plan.imu = plan.gnss = plan.blind_spells = false;
  plan.landmark_spacing_m = 0;
  const auto campaign = run_campaign(plan, 30);
  EXPECT_EQ(campaign.sum.outside, 0U);
  EXPECT_GE(campaign.budget_share, 0.99);
}

// The real map_matcher says all there is to say of the map: the leg behind facing points every 600 m, places by masts and
// balises, of which some are missed, false or elsewhere on the map, and the start of every second train.
TEST(Coverage, MapMatcherTellsWhichLegItIs) {
  SimulationPlan plan = train::campaign_plan();
  plan.duration_s = 120;
  plan.switch_spacing_m = 600;
  train::leave_to_map_matcher(plan);
  const auto told = run_campaign(plan, 6);
  EXPECT_LE(told.p95_m, 0.5);
  plan.start_told = false;
  auto sum = run_campaign(plan, 6).sum;
  EXPECT_LT(2 * sum.placeless, sum.states);
  sum.add(told.sum);
  EXPECT_EQ(sum.outside, 0U);
  EXPECT_GT(sum.other_leg, 0U);  // it is in doubt at times ...
  EXPECT_EQ(sum.other_leg_sure, 0U);
}

// Nobody says where the train begins: the way counts until map_matcher has found the place, to some metres.
TEST(Coverage, APlaceThatIsFoundOnTheWayIsHeld) {
  SimulationPlan plan;
  plan.start_told = false;
  plan.shape = plan.track_fixes = true;
  plan.switch_spacing_m = 1500;
  plan.duration_s = 240;
  const auto campaign = run_campaign(plan, 8, 4000);  // behind it, and a landmark
  EXPECT_EQ(campaign.sum.outside, 0U);
  EXPECT_LE(campaign.p95_m, 2);
}

TEST(Coverage, WheelAloneDriftsInsideItsInterval) {
  SimulationPlan plan;
  plan.camera = plan.imu = plan.gnss = plan.slip = false;
  plan.landmark_spacing_m = 0;
  const auto campaign = run_campaign(plan, 30);
  EXPECT_EQ(campaign.sum.outside, 0U);
}

// The gyro tells map_matcher where curves begin and end.
TEST(Coverage, WithoutACameraCurvesHoldWhatTheWheelMayHaveSlipped) {
  SimulationPlan plan;
  plan.camera = plan.gnss = false;
  plan.landmark_spacing_m = 0;
  plan.duration_s = 600;
  for (const bool shape : {false, true}) {
    plan.shape = shape;
    const auto campaign = run_campaign(plan, 8);
    EXPECT_EQ(campaign.sum.outside, 0U);
    EXPECT_EQ(campaign.budget_share > 0.4, shape) << campaign.budget_share;
  }
}

TEST(Coverage, BlindCameraWithImuOnly) {
  SimulationPlan plan;
  plan.wheel = plan.gnss = false;
  const auto campaign = run_campaign(plan, 12);
  EXPECT_EQ(campaign.sum.outside, 0U);
}

// SUBSET-041 asks for 5 m + 5 % of the way since the reference where nothing malfunctions and the wheels hold: with
// sleepers counted wrong, GNSS outages, a camera that is blind at times and curves that lie elsewhere than on the map.
// These runs were the widest of 50; what is left are starts in the dark (0.3 %; 0.9 % before vague curves began budgets
// no more).
TEST(Coverage, WithoutFaultAndSlipTheIntervalIsWithinTheBudget) {
  train::Verdict sum;
  for (const uint64_t number : {4, 9, 17, 20, 22, 28, 30, 32, 35, 47}) {
    SimulationPlan plan = train::campaign_plan();
    plan.slip = false;
    plan.false_fix_share = 0;
    const train::TrainSimulation simulation(plan, train::seed_of_run(3671, number));
    auto fusion = core::value_or_throw(Fusion::create({}, simulation.map, simulation.start()));
    const auto verdict = train::judge(simulation, fusion);
    EXPECT_EQ(verdict.outside, 0U) << number;
    sum.add(verdict);
  }
  EXPECT_LT(static_cast<double>(sum.wider) / static_cast<double>(sum.states), 0.005);
}

/// The receiver is silent until then, and its places lie `off_m` ahead along the track from there on.
void hear_gnss_from(train::TrainSimulation& simulation, double begin_s, double off_m) {
  std::erase_if(simulation.arrivals, [&](const train::Arrival& arrival) {
    return std::holds_alternative<GnssInput>(arrival.event) && arrival.arrival_s < begin_s;
  });
  std::vector<GnssInput*> fixes;
  for (auto& arrival : simulation.arrivals) {
    if (auto* gnss = std::get_if<GnssInput>(&arrival.event)) fixes.push_back(gnss);
  }
  constexpr size_t kApart = 10;
  for (size_t i = 0; i + kApart < fixes.size(); ++i) {
    const Eigen::Vector2d way(fixes[i + kApart]->easting_m - fixes[i]->easting_m,
                              fixes[i + kApart]->northing_m - fixes[i]->northing_m);
    if (way.norm() < 30) continue;
    fixes[i]->easting_m += off_m * way.x() / way.norm();
    fixes[i]->northing_m += off_m * way.y() / way.norm();
  }
}

// What was known before the first sample, which is used at once, stays in the interval.
TEST(Coverage, GnssThatIsHeardLateMayBeWrong) {
  for (const uint64_t seed : {11, 13, 14, 16, 25, 38}) {  // of 40, those that were outside before it stayed
    SimulationPlan plan = train::campaign_plan();
    plan.landmark_spacing_m = 0;
    plan.shape = false;
    train::TrainSimulation simulation(plan, seed);
    hear_gnss_from(simulation, 100, seed % 2 == 0 ? 24 : -24);
    auto fusion = core::value_or_throw(Fusion::create({}, simulation.map, simulation.start()));
    EXPECT_EQ(train::judge(simulation, fusion).outside, 0U) << seed;
  }
}

// Emergency brakes and starts that bite at once: the motion is another one, no sensor is faulty.
TEST(Coverage, SuddenAccelerationIsFollowed) {
  for (const double mps2 : {2.0, 3.0}) {
    SimulationPlan plan;
    plan.style = train::DriveStyle::sudden(mps2);
    plan.max_speed_mps = 22;
    plan.gnss = plan.slip = plan.blind_spells = false;
    plan.landmark_spacing_m = 0;
    plan.outlier_share = 0;
    const auto campaign = run_campaign(plan, 6);
    EXPECT_EQ(campaign.sum.outside, 0U) << mps2;
    EXPECT_GE(campaign.budget_share, 0.99) << mps2;
  }
}

// Each sensor with each of its faults, on ordinary troubles beside: the short form of railfix-measure-confidence.
TEST(Coverage, OneFaultySensorStaysInsideTheInterval) {
  train::Verdict sum;
  uint64_t seed = 0;
  for (const auto& [sensor, kind] : train::all_faults()) {
    SimulationPlan plan;
    plan.visual_scale_error = 0.004;
    plan.false_fix_share = 0.005;
    core::Random random(++seed);
    plan.fault = train::random_fault(random, sensor, kind, 80);
    plan.track_fixes = plan.shape = true;
    plan.switch_spacing_m = 800;
    plan.duration_s = 80 - kEarlierS;
    plan.fault.begin_s -= kEarlierS;
    plan.fault.end_s -= kEarlierS;
    const train::TrainSimulation simulation(plan, seed);
    auto fusion = core::value_or_throw(Fusion::create({}, simulation.map, simulation.start()));
    const auto verdict = train::judge(simulation, fusion);
    EXPECT_EQ(verdict.outside, 0U) << to_string(sensor) << " " << to_string(kind) << " of size " << plan.fault.size
                                   << ", by up to " << verdict.worst_excess_m << " m";
    sum.add(verdict);
  }
  EXPECT_EQ(sum.wider_unsaid, 0U);
  std::cout << sum.way_m / 1000 << " km, " << sum.states << " states, " << sum.outside << " outside, "
            << static_cast<double>(sum.wider) / static_cast<double>(sum.states) << " wider than 5 m + 5 %\n";
}

// Runs in which the interval once grew to kilometres, or the train was outside it, because fusion believed the wrong
// one.
TEST(Coverage, TheSensorThatIsWrongIsFoundOut) {
  SimulationPlan plan = train::campaign_plan();
  plan.track_fixes = plan.shape = false;
  plan.switch_spacing_m = 0;
  for (const auto& [seed, fault] :
       {std::pair<uint64_t, train::Fault>{11'000'009, {Sensor::wheel, FaultKind::stuck, 109.5, 169.5, 1}},
        {12'000'016, {Sensor::accelerometer, FaultKind::stuck, 111.1, 140.8, 1}},
        {12'000'002, {Sensor::camera, FaultKind::stuck, 78.7, 85.6, 1}},
        {12'000'062, {Sensor::accelerometer, FaultKind::drift, 157.6, 216.1, 2.25}}}) {
    plan.fault = fault;
    plan.slip = fault.sensor == Sensor::wheel;
    const train::TrainSimulation simulation(plan, seed);
    auto fusion = core::value_or_throw(Fusion::create({}, simulation.map, simulation.start()));
    const auto verdict = train::judge(simulation, fusion);
    std::cout << train::to_string(fault.sensor) << " " << train::to_string(fault.kind) << ": " << verdict.wider
              << " of " << verdict.states << " wider than allowed\n";
    EXPECT_EQ(verdict.outside, 0U);
    EXPECT_EQ(verdict.wider_unsaid, 0U);
    EXPECT_LT(static_cast<double>(verdict.wider), 0.25 * static_cast<double>(verdict.states));
  }
}

// It is named, while the camera sees or for how it fails, and no track is blamed for it; a gyro that is well never is.
TEST(Coverage, AGyroThatIsWrongIsFoundOut) {
  SimulationPlan plan = train::campaign_plan();
  plan.blind_spells = false;
  for (const train::Fault& fault : {train::Fault{}, train::Fault{Sensor::gyro, FaultKind::stuck, 60, 160, 1},
                                    train::Fault{Sensor::gyro, FaultKind::bias, 60, 160, 0.05},
                                    train::Fault{Sensor::gyro, FaultKind::bias, 60, 160, -0.2},
                                    train::Fault{Sensor::gyro, FaultKind::noise, 60, 160, 10},
                                    train::Fault{Sensor::gyro, FaultKind::outliers, 60, 160, 1}}) {
    plan.fault = fault;
    for (const uint64_t seed : {13'000'001, 13'000'002, 13'000'003}) {
      const train::TrainSimulation simulation(plan, seed);
      auto fusion = core::value_or_throw(Fusion::create({}, simulation.map, simulation.start()));
      const int64_t begin_ns = stamp_of(simulation.arrivals.front().event);
      size_t named = 0;
      size_t states = 0;
      const auto verdict = train::judge(simulation, fusion, 0, [&](const TrainEstimate& state, double) {
        const double t_s = core::seconds(state.stamp_ns - begin_ns);
        const bool names = state.reason.find("IMU's gyro") != std::string::npos;
        EXPECT_TRUE(!names || fault.sensor == Sensor::gyro) << t_s << " s: " << state.reason;
        if (t_s < 80 || t_s > 160 || state.speed_mps < 5) return;
        ++states;
        named += names ? 1 : 0;
        if (fault.sensor != Sensor::gyro) return;
        EXPECT_EQ(state.reason.find("turns otherwise than this track"), std::string::npos) << train::to_string(fault.kind) << " " << fault.size << ", " << seed << ", " << t_s << " s: " << state.reason;
      });
      EXPECT_EQ(verdict.outside, 0U);
      if (fault.sensor == Sensor::gyro) {
        EXPECT_GT(static_cast<double>(named), 0.8 * static_cast<double>(states))
            << train::to_string(fault.kind) << " " << fault.size << ", " << seed;
      }
    }
  }
}

// Nothing is known before it, so that no gate refuses it.
TEST(Coverage, TheFirstStepMayCountASleeperTooMany) {
  auto fusion = core::value_or_throw(Fusion::create({}, nullptr, std::nullopt));
  constexpr int64_t kBeginNs = 1'700'000'000'000'000'000;
  const auto at = [](int picture) { return kBeginNs + picture * core::kNsPerSecond / 20; };
  const auto first = fusion.add(OdometryInput{at(1), at(0), 2.05, 0.002, true});
  ASSERT_TRUE(first);
  EXPECT_GT(first->over_m, 0.7);
  EXPECT_GT(first->under_m, 0.7);
  const auto second = fusion.add(OdometryInput{at(2), at(1), 2.05, 0.002, true});
  ASSERT_TRUE(second);
  EXPECT_LT(second->over_m, 0.7);
}

}  // namespace
}  // namespace railfix::fusion
