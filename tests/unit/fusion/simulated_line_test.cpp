// The lines of the campaign, random ones and those of a given map.
#include <gtest/gtest.h>

#include "core/units.hpp"
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

/// A stem, points, and a balloon loop that leads back to them: a train comes back over the stem.
std::shared_ptr<const track::Map> balloon_loop() {
  auto map = std::make_shared<track::Map>();
  const double radius_m = 100;
  map->edges = {
      {1, "stem", 1, 2, "", track::Alignment::chained({}, {{1000, 0, 0}})},
      {2, "loop", 2, 2, "",
       track::Alignment::chained({1000, 0, core::kPi / 2}, {{2 * core::kPi * radius_m, 1 / radius_m, 1 / radius_m}})}};
  map->nodes = {{1, track::NodeKind::end, "", 0, 0}, {2, track::NodeKind::railway_switch, "", 1000, 0}};
  map->connections = {{2, 1, 2, false}, {2, 2, 1, true}};
  return map;
}

TEST(SimulatedLine, ATrainThatComesBackOverAnEdgeIsJudgedOnThePassThatItIsOn) {
  SimulationPlan plan;
  plan.duration_s = 5;
  plan.camera = plan.imu = plan.gnss = false;
  const TrainSimulation ride(plan, 1, balloon_loop(), {1, 400, track::Direction::forward});
  const auto error_m = [&](double way_m, double said_m) {
    Motion truth;
    truth.distance_m = way_m;
    return ride.error_m(ride.path().position_at(said_m), truth);
  };
  const double loop_m = ride.path().switches().at(1).distance_m - ride.path().switches().at(0).distance_m;
  for (const double way_m : {100.0, 500.0, 600 + loop_m + 50, 600 + loop_m + 500}) {
    ASSERT_TRUE(error_m(way_m, way_m + 3)) << way_m;
    EXPECT_NEAR(*error_m(way_m, way_m + 3), 3, 1e-6) << way_m;
  }
  // On the stem but turned round: as wrong as the way between the two passes is long.
  EXPECT_NEAR(*error_m(600 + loop_m + 50, 550), -loop_m - 100, 1e-6);
}

}  // namespace
}  // namespace railfix::train
