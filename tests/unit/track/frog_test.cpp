#include "track/frog.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "core/units.hpp"

namespace railfix::track {
namespace {

constexpr double kLegM = 200;

/// As laid down away from the switch, or towards it.
Alignment laid(const PlanPose& points, std::vector<Element> elements, bool forward) {
  const Alignment away = Alignment::chained(points, elements);
  if (forward) return away;
  PlanPose end = away.at(away.length_m()).pose;
  end.heading_rad += core::kPi;
  std::reverse(elements.begin(), elements.end());
  for (Element& element : elements) {
    element = {element.length_m, -element.curvature_end_per_m, -element.curvature_start_per_m};
  }
  return Alignment::chained(end, elements);
}

// Both legs are half a gauge from it, on the sides that face each other.
TEST(FrogPlace, IsOnTheInnerRailsOfBothLegs) {
  const PlanPose points{1000, 2000, 0.7};
  for (const double main_per_m : {0.0, 1.0 / 900, -1.0 / 900}) {
    for (const double turn_per_m : {1.0 / 300, -1.0 / 300, 1.0 / 1200}) {
      for (const bool straight_forward : {true, false}) {
        for (const bool branch_forward : {true, false}) {
          const Alignment straight = laid(points, {{kLegM, main_per_m, main_per_m}}, straight_forward);
          const double k = main_per_m + turn_per_m;
          const Alignment branch = laid(points, {{70, k, k}, {kLegM - 70, main_per_m, main_per_m}}, branch_forward);
          const auto frog = frog_place({&straight, straight_forward}, {&branch, branch_forward});
          ASSERT_TRUE(frog);
          EXPECT_EQ(frog->side, turn_per_m > 0 ? 1 : -1);
          const double left_m = 0.5 * kGaugeM * frog->side * (straight_forward ? 1 : -1);
          const PlanPose pose = straight.at(frog->on_straight_m).pose;
          const auto on_branch = branch.nearest(pose.easting_m - left_m * std::cos(pose.heading_rad),
                                                pose.northing_m + left_m * std::sin(pose.heading_rad));
          EXPECT_NEAR(on_branch.lateral_m, -0.5 * kGaugeM * frog->side * (branch_forward ? 1 : -1), 1e-6);
          EXPECT_NEAR(on_branch.offset_m, frog->on_branch_m, 1e-6);
          const double from_points_m = straight_forward ? frog->on_straight_m : kLegM - frog->on_straight_m;
          EXPECT_NEAR(from_points_m, std::sqrt(2 * kGaugeM / std::abs(turn_per_m)), 0.5);
        }
      }
    }
  }
}

TEST(FrogPlace, IsNoneWhereTheLegsEndBeforeOrBeginApart) {
  const Alignment straight = Alignment::chained({0, 0, 0}, {{kLegM, 0, 0}});
  const Alignment short_leg = Alignment::chained({0, 0, 0}, {{25, 1.0 / 300, 1.0 / 300}});
  EXPECT_FALSE(frog_place({&straight, true}, {&short_leg, true}));
  const Alignment beside = Alignment::chained({4, 0, 0}, {{kLegM, 0, 0}});
  EXPECT_FALSE(frog_place({&straight, true}, {&beside, true}));
}

}  // namespace
}  // namespace railfix::track
