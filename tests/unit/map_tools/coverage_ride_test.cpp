// What coverage says of a way against what the real fusion promises a train with imperfect sensors there.
#include <gtest/gtest.h>

#include <iostream>

#include "map/coverage.hpp"
#include "support/train/verdict.hpp"

namespace railfix::tool {
namespace {

constexpr double kNearly = 1.05;
constexpr double kSightedAheadM = 8;
constexpr double kSightingSigmaM = 0.07;

/// 6 km, straight with frogs, or three curves with frogs at the beginning alone.
std::shared_ptr<const track::Map> line(bool bends) {
  auto map = std::make_shared<track::Map>();
  std::vector<track::Element> elements;
  for (const double per_m : {1.0 / 700, -1.0 / 1200, 1.0 / 500}) {
    const double bend_per_m = bends ? per_m : 0;
    elements.insert(elements.end(),
                    {{1400, 0, 0}, {80, 0, bend_per_m}, {300, bend_per_m, bend_per_m}, {80, bend_per_m, 0}});
  }
  elements.push_back({420, 0, 0});
  map->edges.push_back(
      {1, "line", 1, 2, "", track::Alignment::chained({0, 0, 0}, elements, {{0, 400, 0}, {6000, 420, 0}})});
  map->nodes = {{1, track::NodeKind::end, "", 0, 0}, {2, track::NodeKind::end, "", 0, 6000}};
  uint32_t id = 0;
  for (const double offset_m : {100.0, 220.0, 500.0, 1100.0, 1250.0, 2600.0, 3100.0, 3300.0, 3400.0, 5600.0}) {
    if (!bends || offset_m < 2000)
      map->landmarks.push_back({++id, track::LandmarkKind::frog, 1, offset_m, 0.7, 0.05, ""});
  }
  return map;
}

train::SimulationPlan plan_of_a_good_day(bool bends) {
  train::SimulationPlan plan;
  plan.duration_s = 300;
  plan.max_speed_mps = 25;
  plan.gnss = plan.blind_spells = plan.slip = false;
  plan.outlier_share = plan.false_fix_share = 0;
  plan.visual_scale_error = plan.wheel_scale_error = 0.003;
  plan.map_shape_m = 0.3;
  plan.start_sigma_m = 0.3;
  plan.landmark_spacing_m = 0;
  plan.sightings = true;
  plan.shape = bends;
  return plan;
}

struct Compared {
  double way_m = 0;
  double held_m = 0;   // to a twentieth: these sensors err by more than those of runs with pictures
  double ratio_m = 0;  // of what coverage says, metre by metre
};

// As the camera sights them, for the matcher in the loop.
void sight_landmarks(train::TrainSimulation& simulation) {
  core::Random random = simulation.stream_of(30);
  for (const track::PathLandmark& mark : simulation.path().landmarks()) {
    const double foot_m = mark.distance_m - kSightedAheadM;
    if (foot_m < 1 || foot_m > simulation.way_m()) continue;
    const double t_s = simulation.drive().time_at(foot_m) + 0.003;
    const double ahead_m = mark.distance_m - simulation.drive().at(t_s).distance_m + kSightingSigmaM * random.normal();
    simulation.sightings.push_back(
        {t_s, {simulation.stamp_ns(t_s), mark.kind, ahead_m, mark.lateral_m, kSightingSigmaM, 0.99}});
  }
}

void compare(bool bends, uint64_t seed, Compared& sum) {
  const track::EdgePosition start{1, 5, track::Direction::forward};
  train::TrainSimulation simulation(plan_of_a_good_day(bends), seed, line(bends), start);
  sight_landmarks(simulation);
  // Rides that begin at speed do not know at first that their camera is not late; a line has nothing to do with that.
  auto fusion = core::value_or_throw(fusion::Fusion::create({.camera_lag_s = 1}, simulation.map, simulation.start()));
  const auto promised = promised_on(core::value_or_throw(way_from(simulation.map, start, 1e4)), {});
  double before_m = 0;
  size_t next = 0;
  const auto verdict = train::judge(simulation, fusion, 0, [&](const fusion::TrainEstimate& state, double) {
    const double at_m = simulation.truth_at(state.stamp_ns).distance_m;
    while (next < promised.size() && promised[next].at_m < at_m) ++next;
    if (at_m <= before_m || next == promised.size()) return;
    const double way_m = at_m - std::exchange(before_m, at_m);
    const double half_m = std::max(state.over_m, state.under_m);
    sum.way_m += way_m;
    sum.held_m += half_m <= kNearly * promised[next].half_m ? way_m : 0;
    sum.ratio_m += way_m * promised[next].half_m / half_m;
  });
  EXPECT_EQ(verdict.outside, 0U);
}

void expect_to_hold(bool bends) {
  Compared sum;
  for (const uint64_t seed : {1, 2, 3, 4}) compare(bends, seed, sum);
  std::cout << sum.way_m << " m, held " << sum.held_m / sum.way_m << ", ratio " << sum.ratio_m / sum.way_m << "\n";
  EXPECT_GT(sum.way_m, 8000);
  EXPECT_GE(sum.held_m, 0.95 * sum.way_m);
  EXPECT_LE(sum.ratio_m, 1.5 * sum.way_m);
}

TEST(CoverageRide, HoldsWhatFusionPromisesAndNotMuchMore) {
  expect_to_hold(false);
}

TEST(CoverageRide, DoesSoInCurvesToo) {
  expect_to_hold(true);
}

}  // namespace
}  // namespace railfix::tool
