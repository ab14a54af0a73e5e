#include "track/import/fit/clothoid_fit.hpp"

#include <cmath>

#include "core/random.hpp"
#include "core/units.hpp"
#include "import_fixture.hpp"
#include "track/import/fit/biarc.hpp"
#include "track/import/xml/landxml.hpp"

namespace railfix::track {
namespace {

std::vector<Eigen::Vector2d> drawn(const Alignment& truth, double to_m, double spacing_m, double sigma_m,
                                   uint64_t seed) {
  core::Random random(seed);
  std::vector<Eigen::Vector2d> points;
  for (double s = 0; s <= to_m; s += spacing_m * random.uniform(0.7, 1.3)) {
    const PlanPose pose = truth.at(s).pose;
    const double left = random.normal(0, sigma_m);
    points.emplace_back(pose.easting_m - left * std::cos(pose.heading_rad),
                        pose.northing_m + left * std::sin(pose.heading_rad));
  }
  return points;
}

struct Errors {
  double position_rms_m = 0;
  double curvature_rms_per_m = 0;
};

Errors errors_of(const Alignment& fit, const Alignment& truth) {
  Errors out;
  double count = 0;
  for (double s = 20; s < fit.length_m() - 20; s += 5, ++count) {
    const PlanPose pose = fit.at(s).pose;
    const Alignment::Nearest nearest = truth.nearest(pose.easting_m, pose.northing_m);
    out.position_rms_m += nearest.lateral_m * nearest.lateral_m;
    out.curvature_rms_per_m += std::pow(fit.curvature_at(s) - truth.curvature_at(nearest.offset_m), 2);
  }
  out.position_rms_m = std::sqrt(out.position_rms_m / count);
  out.curvature_rms_per_m = std::sqrt(out.curvature_rms_per_m / count);
  return out;
}

Alignment curve_between_straights() {
  return Alignment::chained(
      {400000, 5300000, 0.4},
      {{400, 0, 0}, {120, 0, 1.0 / 600}, {400, 1.0 / 600, 1.0 / 600}, {120, 1.0 / 600, 0}, {400, 0, 0}});
}

TEST(ClothoidFit, FindsStraightClothoidAndArc) {
  const Alignment truth = curve_between_straights();
  const auto fit = fit_clothoids(drawn(truth, truth.length_m(), 20, 0.05, 3), {});
  ASSERT_TRUE(fit);
  const std::vector<Element>& elements = fit->alignment.elements();
  EXPECT_LT(elements.size(), 25U);  // 75 points
  EXPECT_EQ(elements.front().curvature_start_per_m, 0);
  EXPECT_EQ(elements.front().curvature_end_per_m, 0);
  for (double s = 560; s < 880; s += 20) EXPECT_NEAR(1 / fit->alignment.curvature_at(s), 600, 60) << s;
  EXPECT_LT(errors_of(fit->alignment, truth).position_rms_m, 0.05);
  EXPECT_LT(fit->max_m, 0.25);
  EXPECT_EQ(fit->element_max_m.size(), elements.size());
}

TEST(ClothoidFit, BeginsAndEndsAtThePointsWithTheHeadingsGiven) {
  const Alignment truth = curve_between_straights();
  const std::vector<Eigen::Vector2d> points = drawn(truth, truth.length_m(), 25, 0.3, 4);
  const double end_heading = truth.at(truth.length_m()).pose.heading_rad;
  const auto fit = fit_clothoids(points, {0.4, end_heading, 0});
  ASSERT_TRUE(fit);
  const PlanPose begin = fit->alignment.at(0).pose;
  const PlanPose end = fit->alignment.at(fit->alignment.length_m()).pose;
  EXPECT_NEAR(begin.heading_rad, 0.4, 1e-3);
  EXPECT_NEAR(core::wrap_pi(end.heading_rad - end_heading), 0, 1e-3);
  EXPECT_NEAR(std::hypot(begin.easting_m - points[0].x(), begin.northing_m - points[0].y()), 0, 1e-9);
  EXPECT_NEAR(std::hypot(end.easting_m - points.back().x(), end.northing_m - points.back().y()), 0, 0.01);
}

TEST(ClothoidFit, IsBetterThanArcsThroughThePoints) {
  for (const uint64_t seed : {1, 2, 3, 4}) {
    const Alignment truth = curve_between_straights();
    const std::vector<Eigen::Vector2d> points = drawn(truth, truth.length_m(), 20, 0.7, seed);
    const auto fit = fit_clothoids(points, {});
    ASSERT_TRUE(fit);
    const Errors arcs = errors_of(fit_polyline(points, std::nullopt, std::nullopt).alignment, truth);
    const Errors own = errors_of(fit->alignment, truth);
    EXPECT_LT(own.curvature_rms_per_m, 0.1 * arcs.curvature_rms_per_m);
    EXPECT_LT(own.position_rms_m, arcs.position_rms_m);
    EXPECT_NEAR(fit->sigma_m, 0.7, 0.35);
  }
}

// A mountain line, drawn coarsely: the steps of the fit end early, its end is still met. An edge that ends beside its
// node is a gap that nobody drew.
TEST(ClothoidFit, MeetsTheEndOfAHardDrawing) {
  size_t fitted = 0;
  for (uint64_t seed = 1; seed <= 6; ++seed) {
    core::Random random(seed);
    std::vector<Element> elements;
    for (int i = 0; i < 24; ++i) {
      const double curvature = (random.uniform() < 0.5 ? -1 : 1) / random.uniform(90, 300);
      const double arc_m = std::min(random.uniform(40, 200), 2.0 / std::abs(curvature));
      elements.insert(
          elements.end(),
          {{random.uniform(10, 80), 0, 0}, {30, 0, curvature}, {arc_m, curvature, curvature}, {30, curvature, 0}});
    }
    const Alignment truth = Alignment::chained({400000, 5300000, 0.4}, elements);
    const std::vector<Eigen::Vector2d> points = drawn(truth, truth.length_m(), 30, 0.4, seed);
    const double end_rad =
        truth.at(truth.nearest(points.back().x(), points.back().y()).offset_m).pose.heading_rad + 0.03;
    const auto fit = fit_clothoids(points, {.heading_at_start = 0.4, .heading_at_end = end_rad, .usual_sigma_m = 0.4});
    if (!fit) continue;
    ++fitted;
    const PlanPose end = fit->alignment.at(fit->alignment.length_m()).pose;
    EXPECT_LT(std::hypot(end.easting_m - points.back().x(), end.northing_m - points.back().y()), 0.005) << seed;
    EXPECT_NEAR(core::wrap_pi(end.heading_rad - end_rad), 0, 0.002) << seed;
  }
  EXPECT_GE(fitted, 3U);
}

TEST(DrawingFit, LeavesOutThePointsThatLieApart) {
  const Alignment truth = curve_between_straights();
  std::vector<Eigen::Vector2d> points = drawn(truth, truth.length_m(), 20, 0.1, 5);
  points[20] += Eigen::Vector2d(3.0, -2.0);
  points[50] += Eigen::Vector2d(1.5, 1.5);
  EXPECT_FALSE(fit_clothoids(points, {}));
  const auto fit = fit_drawing(points, {});
  ASSERT_TRUE(fit);
  EXPECT_EQ(fit->left_out, 2U);
  EXPECT_NEAR(fit->left_out_max_m, 3.6, 0.5);
  EXPECT_EQ(fit->arcs_m, 0);
  EXPECT_LT(errors_of(fit->alignment, truth).position_rms_m, 0.1);
}

TEST(DrawingFit, AZigzagSpoilsItsOwnStretchOnly) {
  const Alignment truth =
      Alignment::chained({400000, 5300000, 0.4}, {{1500, 0, 0}, {100, 0, 1.0 / 800}, {900, 1.0 / 800, 1.0 / 800}});
  std::vector<Eigen::Vector2d> points = drawn(truth, truth.length_m(), 20, 0.1, 6);
  for (size_t i = 30; i < 42; ++i) points[i] += Eigen::Vector2d(i % 2 == 0 ? 4.0 : -4.0, 0);  // drawn as a zigzag
  const auto fit = fit_drawing(points, {});
  ASSERT_TRUE(fit);
  EXPECT_LT(fit->arcs_m, 0.5 * truth.length_m());
  // It hangs together, and what was drawn well is where it was drawn.
  const Alignment& track = fit->alignment;
  for (size_t i = 1; i < track.elements().size(); ++i) {
    const PlanPose before = advance(track.starts()[i - 1], track.elements()[i - 1], track.elements()[i - 1].length_m);
    EXPECT_NEAR(
        std::hypot(before.easting_m - track.starts()[i].easting_m, before.northing_m - track.starts()[i].northing_m), 0,
        0.05);
    EXPECT_NEAR(core::wrap_pi(before.heading_rad - track.starts()[i].heading_rad), 0, 0.01);
  }
  for (const double s : {100.0, 300.0, 1300.0, 1900.0, 2300.0}) {
    const PlanPose pose = truth.at(s).pose;
    EXPECT_LT(std::abs(track.nearest(pose.easting_m, pose.northing_m).lateral_m), 0.5) << s;
  }
}

TEST(DrawingFit, FewPointsLeanOnTheUsualScatter) {
  const std::vector<Eigen::Vector2d> points{{0, 0}, {0.1, 40}, {-0.1, 80}, {0, 120}};
  EXPECT_FALSE(fit_clothoids(points, {}));
  const auto fit = fit_clothoids(points, {.heading_at_start = {}, .heading_at_end = {}, .usual_sigma_m = 0.2});
  ASSERT_TRUE(fit);
  EXPECT_EQ(fit->alignment.elements().size(), 1U);
  EXPECT_EQ(fit->alignment.elements()[0].curvature_start_per_m, 0);
}

TEST(ClothoidFit, RefusesWhatIsNoTrack) {
  EXPECT_FALSE(fit_clothoids({{0, 0}, {0, 50}, {0, 100}}, {}));
  EXPECT_FALSE(fit_clothoids({{0, 0}, {0, 50}, {50, 50}, {50, 0}, {0, 0.5}, {0, 60}, {70, 60}, {70, 0}}, {}));
  core::Random random(7);
  for (int i = 0; i < 20; ++i) {
    std::vector<Eigen::Vector2d> points;
    for (int k = 0; k < 12; ++k) points.emplace_back(random.uniform(0, 100), random.uniform(0, 100));
    const auto fit = fit_clothoids(points, {});
    if (fit) {
      EXPECT_TRUE(std::isfinite(fit->alignment.length_m()));
    }
  }
}

// The first 4 km of a real alignment, drawn as OpenStreetMap has it.
TEST(ClothoidFit, ARealAlignmentIsFoundAgain) {
  const std::filesystem::path file = ImportTest::shared_data("alignment/sbb_mszw_a2.landxml");
  if (!std::filesystem::exists(file)) GTEST_SKIP() << "skipped: no " << file;
  const Alignment truth = core::value_or_throw(read_landxml(file)).tracks[0].alignment;
  const auto fit = fit_clothoids(drawn(truth, 4000, 20, 0.5, 11), {});
  ASSERT_TRUE(fit);
  const Errors errors = errors_of(fit->alignment, truth);
  EXPECT_LT(errors.position_rms_m, 0.5);
  EXPECT_LT(errors.curvature_rms_per_m, 5e-4);
  EXPECT_LT(fit->alignment.elements().size(), 90U);  // 200 points
}

}  // namespace
}  // namespace railfix::track
