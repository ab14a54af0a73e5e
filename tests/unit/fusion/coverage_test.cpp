// Does the promised interval hold the truth, over many random runs and every set of sensors?
#include <gtest/gtest.h>

#include <iostream>

#include "unit/fusion/train_simulation.hpp"

namespace railfix::fusion {
namespace {

struct Campaign {
  size_t states = 0;
  size_t outside = 0;
  double worst_excess_m = 0;
  double budget_share = 0;
  std::vector<double> position_m;
};

Campaign run_campaign(const SimulationPlan& plan, int runs, double after_m = 0) {
  Campaign campaign;
  for (int seed = 1; seed <= runs; ++seed) {
    const TrainSimulation simulation(plan, static_cast<uint64_t>(seed));
    auto fusion = Fusion::create({}, simulation.map, simulation.start());
    if (!fusion.ok()) {
      ADD_FAILURE() << fusion.error().message;
      return campaign;
    }
    const auto errors = run_simulation(simulation, fusion.value(), after_m);
    EXPECT_GT(errors.states, 0U);
    if (errors.outside > 0)
      std::cout << "seed " << seed << ": " << errors.outside << " of " << errors.states << " outside, by up to "
                << errors.worst_excess_m << " m\n";
    campaign.states += errors.states;
    campaign.outside += errors.outside;
    campaign.worst_excess_m = std::max(campaign.worst_excess_m, errors.worst_excess_m);
    campaign.budget_share += errors.budget_share / runs;
    campaign.position_m.insert(campaign.position_m.end(), errors.position_m.begin(), errors.position_m.end());
  }
  std::cout << campaign.states << " states, " << campaign.outside << " outside, p50 "
            << quantile(campaign.position_m, 0.5) << " m, p95 " << quantile(campaign.position_m, 0.95) << " m, max "
            << quantile(campaign.position_m, 1) << " m, within budget " << campaign.budget_share << "\n";
  return campaign;
}

TEST(Coverage, AllSensorsWithLandmarksEvery400m) {
  const auto campaign = run_campaign({}, 100, 1250);  // behind the third landmark: scales are known
  EXPECT_EQ(campaign.outside, 0U);
  EXPECT_LE(quantile(campaign.position_m, 0.95), 0.5);
  EXPECT_GE(campaign.budget_share, 0.99);
}

TEST(Coverage, CameraAloneWithLandmarks) {
  SimulationPlan plan;
  plan.wheel = plan.imu = plan.gnss = plan.blind_spells = false;
  const auto campaign = run_campaign(plan, 30, 1250);
  EXPECT_EQ(campaign.outside, 0U);
  EXPECT_LE(quantile(campaign.position_m, 0.95), 0.8);
}

TEST(Coverage, CameraAloneWithoutLandmarksDriftsInsideItsInterval) {
  SimulationPlan plan;
  plan.wheel = plan.imu = plan.gnss = plan.blind_spells = false;
  plan.landmark_spacing_m = 0;
  const auto campaign = run_campaign(plan, 30);
  EXPECT_EQ(campaign.outside, 0U);
  EXPECT_GE(campaign.budget_share, 0.99);
}

TEST(Coverage, WheelAloneDriftsInsideItsInterval) {
  SimulationPlan plan;
  plan.camera = plan.imu = plan.gnss = plan.slip = false;
  plan.landmark_spacing_m = 0;
  const auto campaign = run_campaign(plan, 30);
  EXPECT_EQ(campaign.outside, 0U);
}

TEST(Coverage, BlindCameraWithImuOnly) {
  SimulationPlan plan;
  plan.wheel = plan.gnss = false;
  const auto campaign = run_campaign(plan, 30);
  EXPECT_EQ(campaign.outside, 0U);
}

}  // namespace
}  // namespace railfix::fusion
