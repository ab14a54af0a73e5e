#include "track/track_finder.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "core/random.hpp"
#include "track/import/made/made_network.hpp"

namespace railfix::track {
namespace {

using testing::IsEmpty;

/// Against the search over every edge.
TEST(TrackFinder, FindsEveryTrackWithinTheRadius) {
  const auto map = std::make_shared<const Map>(made_network({.track_km = 100, .seed = 4}));
  const TrackFinder finder(map);
  core::Random random(2);
  size_t found = 0;
  for (int i = 0; i < 60; ++i) {
    const Edge& edge = map->edges[random.next() % map->edges.size()];
    const PlanPose pose = edge.alignment.at(random.uniform(0, edge.alignment.length_m())).pose;
    const double east = pose.easting_m + random.uniform(-100, 100);
    const double north = pose.northing_m + random.uniform(-100, 100);
    const double radius = random.uniform(5, 400);
    const std::vector<NearTrack> near = finder.near(east, north, radius);
    size_t within = 0;
    for (const Edge& other : map->edges) {
      const Alignment::Nearest nearest = other.alignment.nearest(east, north);
      if (std::abs(nearest.lateral_m) > radius) continue;
      ++within;
      const auto same = std::find_if(near.begin(), near.end(), [&](const NearTrack& n) { return n.edge == other.id; });
      ASSERT_NE(same, near.end());
      EXPECT_NEAR(same->lateral_m, nearest.lateral_m, 1e-6);
      EXPECT_NEAR(same->offset_m, nearest.offset_m, 1e-3);
    }
    EXPECT_EQ(near.size(), within);
    for (size_t k = 1; k < near.size(); ++k) EXPECT_LE(std::abs(near[k - 1].lateral_m), std::abs(near[k].lateral_m));
    found += within;
  }
  EXPECT_GT(found, 100U);
  EXPECT_THAT(finder.near(0, 0, 1000), IsEmpty());
}

}  // namespace
}  // namespace railfix::track
