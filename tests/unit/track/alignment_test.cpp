#include "track/alignment.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "core/random.hpp"
#include "core/units.hpp"

namespace railfix::track {
namespace {

/// Simpson's rule in long double with so many steps that its own error is below 1e-10 m.
PlanPose integrated(const PlanPose& start, const Element& element, double distance_m) {
  const int steps = 60000;
  const long double rate =
      (static_cast<long double>(element.curvature_end_per_m) - element.curvature_start_per_m) / element.length_m;
  const auto heading = [&](long double s) {
    return start.heading_rad - (element.curvature_start_per_m + rate * s / 2) * s;
  };
  long double east = 0;
  long double north = 0;
  const long double step = static_cast<long double>(distance_m) / steps;
  for (int i = 0; i <= steps; ++i) {
    const long double weight = i == 0 || i == steps ? 1 : (i % 2 == 1 ? 4 : 2);
    east += weight * std::sin(heading(step * i));
    north += weight * std::cos(heading(step * i));
  }
  return {start.easting_m + static_cast<double>(east * step / 3),
          start.northing_m + static_cast<double>(north * step / 3), static_cast<double>(heading(distance_m))};
}

void expect_near(const PlanPose& a, const PlanPose& b, double tolerance_m) {
  EXPECT_NEAR(a.easting_m, b.easting_m, tolerance_m);
  EXPECT_NEAR(a.northing_m, b.northing_m, tolerance_m);
  EXPECT_NEAR(a.heading_rad, b.heading_rad, 1e-12);
}

TEST(Advance, AgreesWithNumericalIntegrationAtZeroTinyAndLargeCurvature) {
  core::Random random(1);
  const PlanPose start{12.5, -3.25, 0.7};
  std::vector<Element> elements{
      {1000, 0, 0},         {1000, 1e-12, 1e-12}, {1000, 1e-8, 1e-8},  {1000, 0, 1e-10},        {3000, 1e-7, -1e-7},
      {3000, 1.0 / 300, 0}, {3000, 0.02, 0.02},   {3000, 0.02, -0.02}, {2000, 0.02, 0.0200001}, {0.001, 0.01, -0.01}};
  for (int i = 0; i < 10; ++i) {
    elements.push_back({random.uniform(1, 3000), random.uniform(-0.02, 0.02), random.uniform(-0.02, 0.02)});
  }
  for (const Element& element : elements) {
    SCOPED_TRACE(testing::Message() << element.length_m << " " << element.curvature_start_per_m << " "
                                    << element.curvature_end_per_m);
    expect_near(advance(start, element, element.length_m), integrated(start, element, element.length_m), 1e-9);
    expect_near(advance(start, element, -0.1 * element.length_m), integrated(start, element, -0.1 * element.length_m),
                1e-9);
  }
}

TEST(Advance, ArcIsACircle) {
  const PlanPose start{0, 0, 0};  // northwards
  const PlanPose quarter = advance(start, {500 * core::kPi / 2, 1.0 / 500, 1.0 / 500}, 500 * core::kPi / 2);
  EXPECT_NEAR(quarter.easting_m, -500, 1e-9);  // a left curve turns west
  EXPECT_NEAR(quarter.northing_m, 500, 1e-9);
  EXPECT_NEAR(quarter.heading_rad, -core::kPi / 2, 1e-12);
}

TEST(Advance, TakesSmallStepsLikeOneLargeStep) {
  const Element clothoid{200, 0, 1.0 / 300};
  PlanPose pose{0, 0, 2.0};
  for (int i = 0; i < 200; ++i) {
    const double k0 = i / 200.0 / 300.0;
    pose = advance(pose, {1, k0, k0 + 1.0 / 200 / 300}, 1);
  }
  expect_near(pose, advance({0, 0, 2.0}, clothoid, 200), 1e-10);
}

Alignment sample_line() {
  return Alignment::chained({2600000, 1200000, 0.3},
                            {{200, 0, 0},
                             {100, 0, 1.0 / 400},
                             {300, 1.0 / 400, 1.0 / 400},
                             {100, 1.0 / 400, 0},
                             {80, 0, 0},
                             {60, 0, -1.0 / 250},
                             {150, -1.0 / 250, -1.0 / 250},
                             {60, -1.0 / 250, 0},
                             {50, 0, 0}},
                            {{0, 400, 0}, {300, 403, 80}, {700, 399, 100}, {1100, 402, 0}},
                            {{200, 0}, {300, 0.12}, {600, 0.12}, {700, 0}});
}

TEST(Alignment, DerivativesAgreeWithDifferences) {
  const Alignment line = sample_line();
  core::Random random(2);
  for (int i = 0; i < 300; ++i) {
    const double s = random.uniform(1, line.length_m() - 1);
    const double h = 0.01;
    const TrackPoint a = line.at(s - h);
    const TrackPoint b = line.at(s + h);
    const TrackPoint m = line.at(s);
    // Within 0.02 m of a joint the rate jumps; the tolerances allow for that.
    EXPECT_NEAR(std::atan2(b.pose.easting_m - a.pose.easting_m, b.pose.northing_m - a.pose.northing_m),
                m.pose.heading_rad, 1e-6);
    EXPECT_NEAR(-core::wrap_pi(b.pose.heading_rad - a.pose.heading_rad) / (2 * h), m.curvature_per_m, 2e-6);
    EXPECT_NEAR((b.elevation_m - a.elevation_m) / (2 * h), m.grade, 3e-6);
    if (a.curvature_rate_per_m2 == b.curvature_rate_per_m2) {
      EXPECT_NEAR((b.curvature_per_m - a.curvature_per_m) / (2 * h), m.curvature_rate_per_m2, 1e-12);
    }
    if (a.vertical_curvature_per_m == b.vertical_curvature_per_m) {
      EXPECT_NEAR((b.grade - a.grade) / (2 * h), m.vertical_curvature_per_m, 1e-12);
    }
    if (a.twist == b.twist) {
      EXPECT_NEAR((b.cant_m - a.cant_m) / (2 * h), m.twist, 1e-12);
    }
    EXPECT_EQ(line.curvature_at(s), m.curvature_per_m);
  }
}

TEST(Alignment, ContinuesBeyondItsEnds) {
  const Alignment line = sample_line();
  const TrackPoint before = line.at(-10);
  EXPECT_NEAR(before.pose.northing_m, 1200000 - 10 * std::cos(0.3), 1e-9);
  EXPECT_NEAR(before.elevation_m, 400 - 0.1, 1e-9);
  EXPECT_EQ(before.cant_m, 0);
  EXPECT_EQ(line.at(line.length_m() + 10).curvature_per_m, 0);
}

TEST(Alignment, VerticalCurveIsTheParabolaBetweenTheTangents) {
  const Alignment line = Alignment::chained({}, {{1000, 0, 0}}, {{0, 0, 0}, {500, 10, 100}, {1000, 0, 0}});
  EXPECT_NEAR(line.at(500).elevation_m, 10 - 0.04 * 100 / 8, 1e-12);
  EXPECT_NEAR(line.at(500).grade, 0, 1e-12);
  EXPECT_NEAR(line.at(449.999999).elevation_m, line.at(450.000001).elevation_m, 1e-6);
  EXPECT_NEAR(line.at(550).grade, -0.02, 1e-12);
  EXPECT_NEAR(line.at(500).vertical_curvature_per_m, -0.04 / 100, 1e-15);
}

TEST(Alignment, EmptyAlignmentAnswersZero) {
  const Alignment none;
  EXPECT_EQ(none.length_m(), 0);
  EXPECT_EQ(none.at(5).curvature_per_m, 0);
  EXPECT_EQ(none.nearest(1, 2).offset_m, 0);
}

TEST(Alignment, NearestFindsThePlaceItWasMadeFrom) {
  const Alignment line = sample_line();
  core::Random random(3);
  for (int i = 0; i < 500; ++i) {
    const double s = random.uniform(0, line.length_m());
    const double lateral = random.uniform(-60, 60);
    const PlanPose pose = line.at(s).pose;
    const Alignment::Nearest found = line.nearest(pose.easting_m - lateral * std::cos(pose.heading_rad),
                                                  pose.northing_m + lateral * std::sin(pose.heading_rad));
    EXPECT_NEAR(found.offset_m, s, 1e-7);
    EXPECT_NEAR(found.lateral_m, lateral, 1e-7);
  }
}

TEST(Alignment, NearestBeyondTheEndIsTheEnd) {
  const Alignment line = Alignment::chained({0, 0, 0}, {{100, 0, 0}});
  EXPECT_EQ(line.nearest(3, 104).offset_m, 100);
  EXPECT_NEAR(line.nearest(3, 104).lateral_m, -5, 1e-12);  // to the right of it
  EXPECT_EQ(line.nearest(0, -7).offset_m, 0);
}

TEST(Alignment, NearestIsNotFooledByALoop) {
  const double radius = 100;
  const Alignment loop =
      Alignment::chained({0, 0, 0}, {{300, 0, 0}, {1.9 * core::kPi * radius, 1 / radius, 1 / radius}, {300, 0, 0}});
  for (double s = 0; s <= loop.length_m(); s += 7) {
    const PlanPose pose = loop.at(s).pose;
    const Alignment::Nearest found = loop.nearest(pose.easting_m, pose.northing_m);
    EXPECT_NEAR(found.lateral_m, 0, 1e-6);
  }
}

}  // namespace
}  // namespace railfix::track
