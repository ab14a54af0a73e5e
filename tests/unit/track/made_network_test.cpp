#include "track/import/made/made_network.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <memory>
#include <set>

#include "track/import/finish.hpp"
#include "track/import/made/made_lines.hpp"
#include "track/path.hpp"

namespace railfix::track {
namespace {

double length_m(const Map& map) {
  double sum = 0;
  for (const Edge& edge : map.edges) sum += edge.alignment.length_m();
  return sum;
}

TEST(TangentPolygon, RoundsCornersWithoutGapOrKink) {
  const std::vector<Corner> corners{{{0, 1000}, 500, 60}, {{800, 1900}, 400, 80}, {{2000, 1950}, 9000, 100}};
  const RoundedPolygon round = round_corners({0, 0}, corners, {3500, 1400});
  const Alignment chained = Alignment::chained({0, 0, 0}, round.elements);
  for (size_t i = 0; i < round.starts.size(); ++i) {
    EXPECT_NEAR(chained.starts()[i].easting_m, round.starts[i].easting_m, 1e-8);
    EXPECT_NEAR(chained.starts()[i].heading_rad, round.starts[i].heading_rad, 1e-11);
  }
  const PlanPose end = chained.at(round.length_m).pose;
  EXPECT_NEAR(end.easting_m, 3500, 1e-8);
  EXPECT_NEAR(end.northing_m, 1400, 1e-8);
  EXPECT_NEAR(chained.curvature_at(round.straights[0].to_m + 100), -1.0 / 500, 1e-12);
}

TEST(TangentPolygon, ParallelKeepsItsDistance) {
  const std::vector<Corner> corners{{{0, 1000}, 500, 60}, {{800, 1900}, 400, 80}};
  const RoundedPolygon round = round_corners({0, 0}, corners, {2800, 1400});
  const Alignment track = Alignment::chained({0, 0, 0}, round.elements);
  const PlanPose end = track.at(track.length_m()).pose;
  const Eigen::Vector2d left_end =
      Eigen::Vector2d(2800, 1400) + 4.2 * Eigen::Vector2d(-std::cos(end.heading_rad), std::sin(end.heading_rad));
  const RoundedPolygon left = round_corners({-4.2, 0}, parallel_corners({0, 0}, corners, {2800, 1400}, 4.2), left_end);
  const Alignment beside = Alignment::chained({-4.2, 0, 0}, left.elements);
  for (double s = 0; s < beside.length_m(); s += 10) {
    const PlanPose pose = beside.at(s).pose;
    EXPECT_NEAR(track.nearest(pose.easting_m, pose.northing_m).lateral_m, 4.2, 0.05) << s;
  }
}

TEST(MadeNetwork, IsSoundAndOfTheLengthAskedFor) {
  for (const uint64_t seed : {1, 2, 3}) {
    const Map map = made_network({.track_km = 150, .seed = seed});
    EXPECT_NEAR(length_m(map), 150e3, 15e3);
    EXPECT_THAT(check_topology(map), testing::IsEmpty());
    std::set<uint32_t> frogs;
    size_t switches = 0;
    for (const Node& node : map.nodes) switches += node.kind == NodeKind::railway_switch ? 1 : 0;
    size_t count = 0;
    for (const Landmark& mark : map.landmarks) count += mark.kind == LandmarkKind::frog ? 1 : 0;
    EXPECT_GT(switches, 40U);
    EXPECT_GE(count, 2 * switches);  // on both ways of every switch
    EXPECT_GT(map.balise_groups.size(), 50U);
    for (const BaliseGroup& group : map.balise_groups) EXPECT_EQ(group.balises.size(), 2U);
  }
}

TEST(MadeNetwork, IsTheSameForTheSameSeed) {
  const Map a = made_network({.track_km = 60, .seed = 5});
  const Map b = made_network({.track_km = 60, .seed = 5});
  const Map other = made_network({.track_km = 60, .seed = 6});
  ASSERT_EQ(a.edges.size(), b.edges.size());
  for (size_t i = 0; i < a.edges.size(); ++i)
    EXPECT_EQ(a.edges[i].alignment.length_m(), b.edges[i].alignment.length_m());
  EXPECT_NE(length_m(a), length_m(other));
}

TEST(MadeNetwork, ALineRunsSmoothlyThroughItsStations) {
  const auto map = std::make_shared<const Map>(made_network({.track_km = 150, .seed = 2, .mast_spacing_m = 55}));
  const EdgePosition start = map->parse_position("L1:10").value();
  const Path path = core::value_or_throw(Path::follow(map, start, 8000, 0));
  ASSERT_GT(path.end_m(), 5000);
  for (double s = 1; s < path.end_m(); ++s) {
    const TrackPoint a = path.at(s - 1);
    const TrackPoint b = path.at(s);
    EXPECT_NEAR(std::hypot(a.pose.easting_m - b.pose.easting_m, a.pose.northing_m - b.pose.northing_m), 1, 1e-5);
    EXPECT_NEAR(b.elevation_m, a.elevation_m, 0.04);
    EXPECT_LT(std::abs(b.cant_m - a.cant_m), 0.0021);
    EXPECT_LE(std::abs(b.cant_m), 0.15);
  }
}

}  // namespace
}  // namespace railfix::track
