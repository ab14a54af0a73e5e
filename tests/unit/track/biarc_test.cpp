#include "track/import/fit/biarc.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "core/random.hpp"
#include "core/units.hpp"
#include "track/import/fit/smooth.hpp"

namespace railfix::track {
namespace {

void expect_smooth(const PolylineFit& fit) {
  EXPECT_EQ(fit.straightened, 0U);
  EXPECT_LT(fit.figures.max_heading_step_rad, 1e-9);
  EXPECT_LT(fit.figures.max_end_error_m, 1e-8);
}

TEST(Biarc, PointsOnACircleGiveTheCircle) {
  std::vector<Eigen::Vector2d> points;
  for (int i = 0; i <= 10; ++i) points.push_back({300 - 300 * std::cos(0.1 * i), 300 * std::sin(0.1 * i)});
  const PolylineFit fit = fit_polyline(points, std::nullopt, std::nullopt);
  expect_smooth(fit);
  EXPECT_NEAR(fit.alignment.length_m(), 300, 1e-6);
  for (double s = 1; s < 300; s += 10) EXPECT_NEAR(fit.alignment.curvature_at(s), -1.0 / 300, 1e-9);
}

TEST(Biarc, RunsThroughEveryPointOfAWindingLine) {
  core::Random random(4);
  for (int round = 0; round < 20; ++round) {
    std::vector<Eigen::Vector2d> points{{500000, 5300000}};
    double heading = random.uniform(-3, 3);
    for (int i = 0; i < 60; ++i) {
      heading += random.uniform(-0.15, 0.15);
      points.push_back(points.back() + random.uniform(10, 80) * Eigen::Vector2d(std::sin(heading), std::cos(heading)));
    }
    const PolylineFit fit = fit_polyline(points, std::nullopt, std::nullopt);
    expect_smooth(fit);
    for (const Eigen::Vector2d& point : points)
      EXPECT_LT(std::abs(fit.alignment.nearest(point.x(), point.y()).lateral_m), 1e-6);
  }
}

TEST(Biarc, TakesTheHeadingsItIsGiven) {
  const PolylineFit fit = fit_polyline({{0, 0}, {3, 100}}, 0.0, 0.1);
  expect_smooth(fit);
  EXPECT_NEAR(fit.alignment.at(0).pose.heading_rad, 0.0, 1e-12);
  EXPECT_NEAR(fit.alignment.at(fit.alignment.length_m()).pose.heading_rad, 0.1, 1e-9);
}

TEST(Biarc, AStraightLineStaysStraight) {
  const PolylineFit fit = fit_polyline({{0, 0}, {10, 10}, {50, 50}, {500, 500}}, std::nullopt, std::nullopt);
  expect_smooth(fit);
  EXPECT_NEAR(fit.alignment.length_m(), 500 * std::sqrt(2.0), 1e-9);
  EXPECT_LT(fit.figures.max_chord_deviation_m, 1e-9);
}

TEST(Biarc, CountsWhatIsNoTrack) {
  const PolylineFit fit = fit_polyline({{0, 0}, {0, 50}, {50, 50}, {50, 0}, {4, 3}}, std::nullopt, std::nullopt);
  EXPECT_TRUE(std::isfinite(fit.alignment.length_m()));
  const PolylineFit back = fit_polyline({{0, 0}, {0, 50}, {0.5, 0}}, std::nullopt, std::nullopt);
  EXPECT_GT(back.straightened, 0U);
}

TEST(Thinned, LeavesOutPointsThatAreTooNear) {
  EXPECT_EQ(thinned({{0, 0}, {0, 50}, {0.6, 50.5}, {0, 100}}).size(), 3U);
  EXPECT_EQ(thinned({{0, 0}, {0, 50}, {0, 99}, {0, 100}}).size(), 3U);
  EXPECT_EQ(thinned({{0, 0}, {0, 1}}).size(), 2U);
}

/// Straight, clothoid, arc, clothoid, straight, drawn by hand every 25 m.
struct HandDrawn {
  Alignment truth = Alignment::chained(
      {400000, 5300000, 0.4},
      {{300, 0, 0}, {120, 0, 1.0 / 600}, {400, 1.0 / 600, 1.0 / 600}, {120, 1.0 / 600, 0}, {300, 0, 0}});
  std::vector<Eigen::Vector2d> points;

  explicit HandDrawn(double sigma_m) {
    core::Random random(8);
    for (double s = 0; s <= truth.length_m(); s += random.uniform(15, 35)) {
      const PlanPose pose = truth.at(s).pose;
      points.push_back({pose.easting_m + random.normal(0, sigma_m), pose.northing_m + random.normal(0, sigma_m)});
    }
  }
  [[nodiscard]] double curvature_error(const std::vector<Eigen::Vector2d>& through) const {
    const Alignment track = fit_polyline(through, std::nullopt, std::nullopt).alignment;
    double sum = 0;
    int count = 0;
    for (double s = 50; s < track.length_m() - 50; s += 5, ++count) {
      const PlanPose pose = track.at(s).pose;
      const double error =
          track.curvature_at(s) - truth.curvature_at(truth.nearest(pose.easting_m, pose.northing_m).offset_m);
      sum += error * error;
    }
    return std::sqrt(sum / count);
  }
};

TEST(Smoothed, EvensOutTheCurvatureOfHandDrawnPoints) {
  const HandDrawn drawn(0.15);
  const std::vector<Eigen::Vector2d> smooth = smoothed(drawn.points, 1.0);
  EXPECT_LT(drawn.curvature_error(smooth), 0.2 * drawn.curvature_error(drawn.points));
  EXPECT_EQ(smooth.front(), drawn.points.front());
  EXPECT_EQ(smooth.back(), drawn.points.back());
}

TEST(Smoothed, KeepsEveryPointWithinTheLimit) {
  HandDrawn drawn(0.3);
  drawn.points[10] += Eigen::Vector2d(3, 3);  // an outlier
  for (const double limit : {0.05, 0.3, 1.0}) {
    const std::vector<Eigen::Vector2d> smooth = smoothed(drawn.points, limit);
    for (size_t i = 0; i < smooth.size(); ++i) EXPECT_LE((smooth[i] - drawn.points[i]).norm(), limit);
    EXPECT_GT((smooth[5] - drawn.points[5]).norm(), 0);
  }
  EXPECT_EQ(smoothed(drawn.points, 0), drawn.points);
}

TEST(Smoothed, LeavesACleanLineAlone) {
  const HandDrawn drawn(0);
  const std::vector<Eigen::Vector2d> smooth = smoothed(drawn.points, 1.0);
  for (size_t i = 0; i < smooth.size(); ++i) EXPECT_LT((smooth[i] - drawn.points[i]).norm(), 0.15);
}

}  // namespace
}  // namespace railfix::track
