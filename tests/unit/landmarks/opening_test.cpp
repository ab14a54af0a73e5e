#include <gtest/gtest.h>

#include <cmath>

#include "core/random.hpp"
#include "track_detector/opening_fit.hpp"
#include "unit/landmarks/seen_along_track.hpp"

namespace railfix::track_detector {
namespace {

constexpr double kPlaceM = 100;
constexpr double kHalfM = 2.7;
constexpr double kLookM = 0.74;
constexpr double kNearestM = 7.5;

/// Both sides of an opening as a train sees them that comes nearer along a curve.
struct Approach {
  SettledEdge left, right;

  Approach(double curvature_per_m, double noise, double yaw_noise, size_t looks = 30, double right_m = -kHalfM) {
    core::Random random(7);
    for (auto* edge : {&left, &right}) {
      edge->curvature_per_m = curvature_per_m;
      // As each edge alone may tell, when the curve was followed wrongly.
      edge->place_m = kPlaceM + (edge == &left ? 0.15 : -0.1);
      edge->lateral_m = edge == &left ? kHalfM : right_m;
    }
    for (size_t i = 0; i < looks; ++i) {
      const double ahead_m = kNearestM + kLookM * static_cast<double>(looks - 1 - i);
      const double yaw_rad = yaw_noise * random.normal();
      for (auto* edge : {&left, &right}) {
        const double bearing =
            bearing_of(ahead_m, edge->lateral_m, curvature_per_m) + yaw_rad + noise * random.normal();
        edge->measured[edge->count++] = {kPlaceM - ahead_m, bearing, 0, 0, static_cast<int64_t>(i)};
      }
    }
  }
};

TEST(Opening, BothSidesTellItsPlaceWhateverTheYawIs) {
  for (const double curvature_per_m : {0.0, 0.002, -0.004}) {
    const Approach seen(curvature_per_m, 2e-4, 2e-3);
    const auto opening = opening_between(seen.left, seen.right);
    ASSERT_TRUE(opening) << curvature_per_m;
    EXPECT_NEAR(opening->place_m, kPlaceM, 0.03) << curvature_per_m;
    EXPECT_NEAR(opening->width_m, 2 * kHalfM, 0.02) << curvature_per_m;
    EXPECT_EQ(opening->last.stamp_ns, 29);
    EXPECT_NEAR(opening->last_ahead_m, kNearestM, 0.03) << curvature_per_m;
    EXPECT_LT(std::abs(opening->last_ahead_m - kNearestM), 3 * opening->sigma_m);
    EXPECT_LT(opening->sigma_m, 0.03);
    EXPECT_LT(std::abs(opening->width_m - 2 * kHalfM), 3 * opening->width_sigma_m);
  }
}

TEST(Opening, ForTwoTracksItIsAsWideAsItIsInACurveToo) {
  for (const double curvature_per_m : {0.0, 0.003, -0.003}) {
    const Approach seen(curvature_per_m, 1e-4, 1e-3, 30, -6.8);
    const auto opening = opening_between(seen.left, seen.right);
    ASSERT_TRUE(opening) << curvature_per_m;
    EXPECT_NEAR(opening->width_m, kHalfM + 6.8, 0.03) << curvature_per_m;
    EXPECT_NEAR(opening->last_ahead_m, kNearestM, 0.03) << curvature_per_m;
  }
}

TEST(Opening, LooksAtOtherEdgesAreLeftOut) {
  Approach seen(0, 1e-4, 1e-3);
  for (const size_t i : {3, 14, 25}) seen.left.measured[i].bearing += 0.006;
  const auto opening = opening_between(seen.left, seen.right);
  ASSERT_TRUE(opening);
  EXPECT_NEAR(opening->place_m, kPlaceM, 0.03);
}

TEST(Opening, AnotherEdgeThatWasFollowedFarAwayIsLeftOut) {
  Approach seen(0, 1e-4, 1e-3);
  for (size_t i = 0; i < 10; ++i) seen.right.measured[i].bearing += 0.0065;
  const auto opening = opening_between(seen.left, seen.right);
  ASSERT_TRUE(opening);
  EXPECT_NEAR(opening->last_ahead_m, kNearestM, 0.02);
}

TEST(Opening, IsNotToldFromTooLittleNorFromTwoThings) {
  const Approach few(0, 0, 0, 7);
  EXPECT_FALSE(opening_between(few.left, few.right));
  Approach never_together(0, 0, 0);
  for (size_t i = 0; i < never_together.left.count; ++i) never_together.left.measured[i].way_m += 0.3;
  EXPECT_FALSE(opening_between(never_together.left, never_together.right));
  Approach far(0, 0, 0);
  far.left.count = far.right.count = 9;  // hardly nearer than at first
  EXPECT_FALSE(opening_between(far.left, far.right));
  const Approach wild(0, 0.01, 0);
  EXPECT_FALSE(opening_between(wild.left, wild.right));
  Approach away(0, 0, 0);  // what runs ahead of the train
  for (auto* edge : {&away.left, &away.right}) {
    for (size_t i = 0, k = edge->count - 1; i < k; ++i, --k)
      std::swap(edge->measured[i].bearing, edge->measured[k].bearing);
  }
  EXPECT_FALSE(opening_between(away.left, away.right));
}

}  // namespace
}  // namespace railfix::track_detector
