// The random lines of the campaign.
#include <gtest/gtest.h>

#include "support/train/simulation.hpp"

namespace railfix::train {
namespace {

TEST(SimulatedLine, TheTrainBeginsOnItHoweverDenseThePointsAre) {
  SimulationPlan plan;
  plan.duration_s = 5;
  plan.camera = plan.imu = plan.gnss = false;
  for (const double spacing_m : {1.0, 50.0, 200.0, 1500.0}) {
    plan.switch_spacing_m = spacing_m;
    for (uint64_t seed = 0; seed < 20; ++seed) EXPECT_NO_THROW(TrainSimulation(plan, seed)) << spacing_m << " " << seed;
  }
}

}  // namespace
}  // namespace railfix::train
