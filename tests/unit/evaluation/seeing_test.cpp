#include "evaluation/seeing.hpp"

#include <gtest/gtest.h>

#include "made_truth.hpp"

namespace railfix::evaluation {
namespace {

/// Points of both inner edges of a track of constant curvature, moved sideways in the picture.
std::vector<RailPoint> rail_points(const MadeTruth& made, double shift_px) {
  std::vector<RailPoint> points;
  const geometry::View view(MadeTruth::intrinsics(), made.camera);
  for (int i = 0; i < 20; ++i) {
    for (const bool left : {true, false}) {
      for (double x = 8; x < 60; x *= 1.2) {
        const double y = (left ? 1 : -1) * kGaugeM / 2 + made.curvature_per_m * x * x / 2;
        const auto pixel = view.project({x, y, 0});
        points.push_back({made.row(i + 0.03).stamp_ns, left, pixel->x() + shift_px, pixel->y()});
      }
    }
  }
  return points;
}

TEST(Edges, ExactPointsHaveNoErrorStraightAndInCurves) {
  for (const double curvature : {0.0, 1.0 / 300, -1.0 / 190}) {
    MadeTruth made;
    made.curvature_per_m = curvature;
    const auto result = judge_edges(made.make(), rail_points(made, 0));
    EXPECT_TRUE(result.not_possible.empty());
    EXPECT_LT(result.normal_px.max, 0.05) << curvature;
    EXPECT_LT(result.horizontal_px.max, 0.1) << curvature;
    EXPECT_EQ(result.points_per_rail, 12);
  }
}

TEST(Edges, AShiftAlongTheRowIsFoundAlongTheRow) {
  const MadeTruth made;
  const auto result = judge_edges(made.make(), rail_points(made, 2));
  EXPECT_NEAR(result.horizontal_px.p50, 2, 0.05);
  EXPECT_LT(result.normal_px.p50, 2);
  EXPECT_GT(result.normal_px.p50, 0.5);
}

TEST(Edges, CurvatureThatChangesAheadIsFollowed) {
  // Straight up to 1500 m, an arc behind; the train stands 20 m in front of it.
  MadeTruth made;
  std::vector<dataset::TruthRow> rows;
  for (int i = 0; i <= 500; ++i) {
    rows.push_back(made.row(i / 10.0));
    rows.back().curvature_per_m = rows.back().distance_m < 1500 ? 0 : 1e-3;
  }
  const Truth truth(rows, std::nullopt, std::nullopt);
  const auto train = *truth.at(24 * kSecond);  // 1480 m
  const auto track = truth.track_ahead(train, {10, 20, 30, 40, 50, 60});
  EXPECT_NEAR(track[0].y_m, 0, 1e-9);
  EXPECT_NEAR(track[5].y_m, 1e-3 * 40 * 40 / 2, 0.06);
}

TEST(Edges, WithoutCalibrationOrPointsThereIsAReasonInsteadOfAFigure) {
  const MadeTruth made;
  const Truth bare(made.make().rows(), std::nullopt, std::nullopt);
  EXPECT_NE(judge_edges(bare, rail_points(made, 0)).not_possible, "");
  EXPECT_NE(judge_edges(made.make(), {}).not_possible, "");
}

TEST(Views, BiasSpreadAndHonestSigmas) {
  const MadeTruth made;
  std::vector<ViewRow> rows;
  for (int i = 0; i < 100; ++i) {
    const auto real = made.row(i / 10.0);
    ViewRow row;
    row.stamp_ns = real.stamp_ns;
    row.seen = i < 80;
    row.value = {made.camera.roll_rad + 0.002,
                 made.camera.pitch_rad,
                 made.camera.yaw_rad,
                 made.camera.lateral_m,
                 made.camera.height_m + (i % 2 == 0 ? 0.03 : -0.01),
                 1e-4,
                 0};
    row.sigma.fill(0.01);
    rows.push_back(row);
  }
  const auto result = judge_views(made.make(), rows);
  EXPECT_EQ(result.seen_percent, 80);
  EXPECT_NEAR(result.fields[0].bias, 0.002, 1e-12);
  EXPECT_NEAR(result.fields[4].bias, 0.01, 1e-12);
  EXPECT_NEAR(result.fields[4].rms, std::sqrt((0.0009 + 0.0001) / 2), 1e-12);
  EXPECT_NEAR(result.fields[4].absolute.max, 0.03, 1e-12);
  EXPECT_EQ(result.fields[4].within_2_sigma_percent, 50);
  EXPECT_EQ(result.curvature.size(), 80U);
  EXPECT_NEAR(result.fields[5].bias, 1e-4, 1e-15);
}

// What nobody could see is not asked for.
TEST(Views, SeenIsCountedWhereTheRailsAreVisible) {
  const MadeTruth made;
  auto truth = made.make();
  std::vector<ViewRow> rows;
  std::vector<dataset::TruthVisibility> visibility;
  for (int i = 0; i < 10; ++i) {
    ViewRow row;
    row.stamp_ns = made.row(i).stamp_ns;
    row.seen = i >= 4;
    rows.push_back(row);
    visibility.push_back({row.stamp_ns, i < 3 ? 0.2 : 0.9});
  }
  EXPECT_EQ(judge_views(truth, rows).visible, 0U);
  EXPECT_TRUE(std::isnan(judge_views(truth, rows).seen_of_visible_percent));
  truth.set_visibility(visibility);
  const auto result = judge_views(truth, rows);
  EXPECT_EQ(result.seen_percent, 60);
  EXPECT_EQ(result.visible, 7U);
  EXPECT_NEAR(result.seen_of_visible_percent, 100.0 * 6 / 7, 1e-9);
}

TEST(Sightings, PrecisionRecallAndPositionError) {
  MadeTruth made;  // 1000 m to 2000 m, reference point 8 m ahead
  made.landmarks = {{{"balise", 1100, 0},
                     {"balise", 1103, 0},
                     {"mast", 1200, 3},
                     {"mast", 1260, 3},
                     {"balise", 1004, 0},
                     {"balise", 2100, 0}}};
  std::vector<SightingRow> rows;
  const auto say = [&](const char* kind, double at_m) {
    rows.push_back({made.row((at_m - 8 - 1000) / 20).stamp_ns, kind, 8});
  };
  say("balise", 1100.3);
  say("balise", 1103.1);
  say("balise", 1103.5);  // the second one is used
  say("mast", 1201.9);
  say("mast", 1262.5);  // more than 2 m off
  say("bridge", 1500);
  const auto result = judge_sightings(made.make(), rows, made.make().whole());
  ASSERT_TRUE(result);
  EXPECT_EQ(result->all.real, 4U);  // 1004 m was passed before the run began, 2100 m lies behind its end
  EXPECT_EQ(result->all.said, 6U);
  EXPECT_EQ(result->all.right, 3U);
  const auto& balises = result->kinds.at("balise");
  EXPECT_EQ(balises.recall_percent(), 100);
  EXPECT_NEAR(balises.precision_percent(), 200.0 / 3, 1e-9);
  EXPECT_NEAR(balises.error_m.max, 0.3, 1e-6);
  EXPECT_NEAR(balises.bias_m, 0.2, 1e-6);
  EXPECT_EQ(result->kinds.at("mast").recall_percent(), 50);
  EXPECT_EQ(result->kinds.at("bridge").precision_percent(), 0);
  EXPECT_TRUE(std::isnan(result->kinds.at("bridge").recall_percent()));
}

// Balises are reported 8 m ahead, masts 25 m: at the ends of the run that makes a difference.
TEST(Sightings, EveryKindHasItsOwnReferencePoint) {
  MadeTruth made;  // 1000 m to 2000 m
  made.landmarks = {{{"balise", 1010, 0},
                     {"balise", 1500, 0},
                     {"balise", 2003, 0},
                     {"mast", 1015, 3},
                     {"mast", 1500, 3},
                     {"mast", 1600, 3},
                     {"mast", 2020, 3},
                     {"mast", 1024, 3}}};
  std::vector<SightingRow> rows;
  const auto say = [&](const char* kind, double at_m, double ahead_m) {
    rows.push_back({made.row((at_m - ahead_m - 1000) / 20).stamp_ns, kind, ahead_m});
  };
  for (const double at_m : {1010.0, 1500.0, 2003.0}) say("balise", at_m, 8);
  for (const double at_m : {1500.0, 1600.0, 2020.0}) say("mast", at_m, 25);
  say("mast", 1024, 20);  // nearer than masts usually are
  const auto result = judge_sightings(made.make(), rows, made.make().whole());
  ASSERT_TRUE(result);
  EXPECT_EQ(result->kinds.at("balise").real, 3U);
  EXPECT_EQ(result->kinds.at("balise").right, 3U);
  EXPECT_EQ(result->kinds.at("mast").real, 4U) << "that at 1015 m could not be reported, that at 1024 m was";
  EXPECT_EQ(result->kinds.at("mast").right, 4U);
  EXPECT_EQ(result->all.recall_percent(), 100);
  EXPECT_EQ(result->all.precision_percent(), 100);
}

TEST(Sightings, KindsThatWereNeverReportedHaveARecall) {
  MadeTruth made;
  made.landmarks = {{{"frog", 1500, 0}}};
  const auto result = judge_sightings(made.make(), {}, made.make().whole());
  EXPECT_EQ(result->kinds.at("frog").recall_percent(), 0);
  made.landmarks.reset();
  EXPECT_FALSE(judge_sightings(made.make(), {}, made.make().whole()).has_value());
}

}  // namespace
}  // namespace railfix::evaluation
