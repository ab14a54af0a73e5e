// Switches, neighbouring tracks and things beside the path are where the truth says.
#include <gmock/gmock.h>

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

#include "core/units.hpp"
#include "scene.hpp"
#include "simulator/dataset_writer.hpp"

namespace railfix::simulator {
namespace {

RenderOptions quiet_camera() {
  auto options = small_camera();
  options.read_noise_grey = 0.0;
  options.shot_noise_grey = 0.0;
  options.vignetting = 0.0;
  return options;
}

constexpr double kWebGrey = 0.09 * 235.0;  // the rail's side beside its head

// Mean error (px, along the row) of one rail's inner edge: where the truth says that the edge
// goes through a pixel, the pixel is a mix of head and side; the edge is as wide as the pixel across it.
double mean_edge_error(const Line& line, const RenderOptions& options, const Shot& shot, const cv::Mat& picture,
                       int side) {
  double sum = 0.0;
  int count = 0;
  for (double ahead = 5.2; ahead < 9.0; ahead += 0.02) {
    const auto pixel = rail_edge_px(line, truth_of(shot), options.camera, ahead, side);
    const auto beyond = rail_edge_px(line, truth_of(shot), options.camera, ahead + 0.01, side);
    if (!pixel || pixel->y() > options.camera.height_px - 2) continue;
    const double slope = (beyond->x() - pixel->x()) / (beyond->y() - pixel->y());
    const int row = static_cast<int>(std::lround(pixel->y()));
    const double expected = pixel->x() + slope * (row - pixel->y());
    const int column = static_cast<int>(std::lround(expected));
    if (std::abs(expected - column) > 0.3) continue;
    const int out = side > 0 ? -1 : 1;
    const double bright = picture.at<uint8_t>(row, column + 2 * out);
    const double share = (picture.at<uint8_t>(row, column) - kWebGrey) / (bright - kWebGrey);
    const double seen = column - out * (share - 0.5) * std::hypot(1.0, slope);
    sum += seen - expected;
    ++count;
  }
  EXPECT_GT(count, 50);
  return sum / count;
}

TEST(Switch, OwnRailsLieWhereTheTruthSaysOnBothLegs) {
  struct Case {
    const char* what;
    std::vector<uint32_t> via;
    double distance_m;  // the switch begins at 30 m
  };
  for (const auto& one : {Case{"before the switch", {}, 5.0}, Case{"diverging, blades ahead", {4}, 22.0},
                          Case{"diverging, on the blades", {4}, 31.0}, Case{"diverging, behind the frog", {4}, 62.0},
                          Case{"straight, on the blades", {}, 31.0}}) {
    const auto line = line_from("1:1350", one.via);
    auto options = quiet_camera();
    options.camera.fu_px = options.camera.fv_px = 1152.0;
    const auto shot = standing_at(one.distance_m);
    const cv::Mat picture = Renderer(line, options).render(shot);
    for (const int side : {1, -1})
      EXPECT_NEAR(mean_edge_error(*line, options, shot, picture, side), 0.0, 0.03) << one.what << side;
  }
}

// Grey at a place of the rail-head plane.
double grey_at(const cv::Mat& picture, const geometry::View& view, double x, double y, double z = 0.0) {
  const auto pixel = view.project({x, y, z});
  return picture.at<uint8_t>(static_cast<int>(std::lround(pixel->y())), static_cast<int>(std::lround(pixel->x())));
}

TEST(Switch, FrogIsWhereTheMapSays) {
  const auto line = line_from("2:5");
  const auto frog = std::find_if(line->things().begin(), line->things().end(),
                                 [](const Thing& thing) { return thing.kind == track::LandmarkKind::frog; });
  ASSERT_NE(frog, line->things().end());
  const auto shot = standing_at(frog->distance_m - 7.0);
  const auto options = quiet_camera();
  const cv::Mat picture = Renderer(line, options).render(shot);
  const geometry::View view(options.camera, shot.pose);
  // The own gauge face is broken by the other wheels' groove just before the point and whole 0.6 m around it.
  const double face = frog->lateral_m + std::copysign(0.015, frog->lateral_m);
  EXPECT_LT(grey_at(picture, view, 6.85, face), 70.0);
  EXPECT_GT(grey_at(picture, view, 6.3, face), 110.0);
  EXPECT_GT(grey_at(picture, view, 7.6, face), 110.0);
  // A check rail stands beside the other rail.
  EXPECT_GT(grey_at(picture, view, 7.0, -std::copysign(0.648, frog->lateral_m)), 60.0);
  // The same place from the diverging leg.
  const auto diverging = line_from("1:1350", {4});
  const auto other = std::find_if(diverging->things().begin(), diverging->things().end(),
                                  [](const Thing& thing) { return thing.kind == track::LandmarkKind::frog; });
  ASSERT_NE(other, diverging->things().end());
  EXPECT_LT(other->lateral_m, 0.0);
  const auto a = line->path().at(frog->distance_m);
  const auto b = diverging->path().at(other->distance_m);
  const auto place = [](const track::TrackPoint& at, double lateral) {
    return Eigen::Vector2d(at.pose.easting_m - lateral * std::cos(at.pose.heading_rad),
                           at.pose.northing_m + lateral * std::sin(at.pose.heading_rad));
  };
  EXPECT_LT((place(a, frog->lateral_m) - place(b, other->lateral_m)).norm(), 0.002);
}

TEST(Neighbours, HaveRailsOfTheirOwn) {
  const auto line = line_from("3:1050");
  const auto tracks = line->tracks_at(100.0);
  ASSERT_EQ(tracks.size(), 2U);
  EXPECT_NEAR(tracks[1], 4.2, 0.01);
  const auto shot = standing_at(100.0);
  const auto options = quiet_camera();
  const cv::Mat picture = Renderer(line, options).render(shot);
  const geometry::View view(options.camera, shot.pose);
  const auto here = line->path().at(100.0);
  ASSERT_LT(std::abs(here.curvature_per_m), 1e-6);
  for (const double side : {-1.0, 1.0}) EXPECT_GT(grey_at(picture, view, 9.0, 4.2 + side * 0.745), 110.0);
  // Near a neighbour's rails the truth has none of its own.
  for (const int side : {1, -1}) {
    const auto pixel = rail_edge_px(*line, truth_of(shot), options.camera, 9.0, side);
    EXPECT_NEAR(view.on_plane(*pixel, 0.0)->y(), side * 0.7175, 1e-6);
  }
}

// Where the grey along a row of places first falls by a share of the way from bright to dark, from y = from on.
double falls_at(const cv::Mat& picture, const geometry::View& view, double x, double z, double from, double to,
                double share) {
  std::vector<double> greys;
  constexpr int kSteps = 400;
  for (int i = 0; i <= kSteps; ++i) {
    const auto pixel = view.project({x, from + (to - from) * i / kSteps, z});
    cv::Mat one;
    cv::getRectSubPix(picture, cv::Size(1, 1),
                      cv::Point2f(static_cast<float>(pixel->x()), static_cast<float>(pixel->y())), one, CV_32F);
    greys.push_back(static_cast<double>(one.at<float>(0, 0)));
  }
  const double bright = *std::max_element(greys.begin(), greys.end());
  const double limit = bright - share * (bright - *std::min_element(greys.begin(), greys.end()));
  const auto first = std::find_if(greys.begin(), greys.end(), [&](double grey) { return grey < limit; });
  return from + (to - from) * static_cast<double>(first - greys.begin()) / kSteps;
}

TEST(Things, MastAndPortalAreWhereTheMapSays) {
  const auto options = quiet_camera();
  const auto line = line_from("1:100");
  const auto& mast =
      *std::find_if(line->masts().begin(), line->masts().end(), [](const Mast& one) { return one.distance_m > 40.0; });
  auto shot = standing_at(mast.distance_m - 20.0);
  const geometry::View view(options.camera, shot.pose);
  const double away = mast.lateral_m > 0.0 ? 1.0 : -1.0;
  const double outer = falls_at(Renderer(line, options).render(shot), view, 19.87, 5.0, mast.lateral_m + away * 0.6,
                                mast.lateral_m, 0.5);
  EXPECT_NEAR(outer, mast.lateral_m + away * 0.13, 0.04);

  const auto tunnel = line_from("3:700");
  const auto& bore = tunnel->tunnels().at(0);
  shot = standing_at(bore.begin_m - 20.0);
  const auto here = tunnel->path().at(shot.distance_m);
  const auto portal = tunnel->path().at(bore.begin_m);
  const double turn = here.pose.heading_rad - portal.pose.heading_rad;
  const double de = portal.pose.easting_m - here.pose.easting_m;
  const double dn = portal.pose.northing_m - here.pose.northing_m;
  const double x = de * std::sin(here.pose.heading_rad) + dn * std::cos(here.pose.heading_rad);
  const double y = -de * std::cos(here.pose.heading_rad) + dn * std::sin(here.pose.heading_rad);
  ASSERT_LT(std::abs(turn), 0.06);
  // Into the opening from its left: at the wall's edge it gets dark.
  const double edge = falls_at(Renderer(tunnel, options).render(shot), view, x, 2.2, y + 4.0, y, 0.15);
  EXPECT_NEAR(edge, y + 2.7, 0.12);
}

TEST(Things, LandmarksOfTheTrackBesideAreKnownToo) {
  const auto line = line_from("1:1350", {4});
  const auto platform = std::find_if(line->things().begin(), line->things().end(),
                                     [](const Thing& thing) { return thing.kind == track::LandmarkKind::platform; });
  ASSERT_NE(platform, line->things().end());
  EXPECT_FALSE(platform->own);
  EXPECT_NEAR(platform->lateral_m, -1.67 - 4.7, 0.02);
}

TEST(Ground, LooksTheSameFromEveryStart) {
  const auto options = quiet_camera();
  const auto a = line_from("1:100");
  const auto b = line_from("1:160.3");
  const cv::Mat first = Renderer(a, options).render(standing_at(90.3));
  const cv::Mat second = Renderer(b, options).render(standing_at(30.0));
  cv::Mat difference;
  cv::absdiff(first.rowRange(200, 512), second.rowRange(200, 512), difference);
  EXPECT_LT(cv::mean(difference)[0], 0.2);
}

TEST(Ground, StonesLieAsDeepAsTheyShow) {
  // From another height the same stones are seen in another direction: the depth at which two pictures agree is
  // theirs. Nothing lies above the sleepers' tops or deeper than 8 cm below them, and some of it clearly deeper.
  const auto line = line_from("1:100");
  auto options = quiet_camera();
  options.ballast_depth_m = 0.22;
  const Renderer renderer(line, options);
  const auto low = standing_at(50.0);
  auto high = low;
  high.pose.height_m = 2.9;
  const cv::Mat pictures[] = {renderer.render(low), renderer.render(high)};
  const geometry::View views[] = {{options.camera, low.pose}, {options.camera, high.pose}};
  const auto patch = [&](int k, double x, double depth) {
    cv::Mat u(12, 60, CV_32FC1);
    cv::Mat v(12, 60, CV_32FC1);
    for (int i = 0; i < u.rows; ++i) {
      for (int j = 0; j < u.cols; ++j) {
        const auto pixel = views[k].project({x + i * 0.01, -0.3 + j * 0.01, -depth});
        u.at<float>(i, j) = static_cast<float>(pixel->x());
        v.at<float>(i, j) = static_cast<float>(pixel->y());
      }
    }
    cv::Mat values;
    cv::remap(pictures[k], values, u, v, cv::INTER_LINEAR);
    return values;
  };
  int deep = 0;
  int agreeing = 0;
  for (double x = 4.6; x < 6.4; x += 0.06) {
    double best = 0.0;
    double best_depth = 0.0;
    for (double depth = 0.10; depth < 0.34; depth += 0.01) {
      cv::Mat score;
      cv::matchTemplate(patch(0, x, depth), patch(1, x, depth), score, cv::TM_CCOEFF_NORMED);
      const auto value = static_cast<double>(score.at<float>(0, 0));
      if (value > best) {
        best = value;
        best_depth = depth;
      }
    }
    if (best < 0.85) continue;
    ++agreeing;
    EXPECT_GT(best_depth, 0.15) << x;
    EXPECT_LT(best_depth, 0.285) << x;
    deep += best_depth > 0.205 ? 1 : 0;
  }
  EXPECT_GT(agreeing, 8);
  EXPECT_GT(deep, 2);
}

std::shared_ptr<track::Map> straight_line_of_5_km() {
  auto map = std::make_shared<track::Map>();
  map->edges.push_back({1, "line", 1, 2, "", track::Alignment::chained({0, 0, 0}, {{5000, 0, 0}})});
  map->nodes = {{1, track::NodeKind::end, "", 0, 0}, {2, track::NodeKind::end, "", 0, 5000}};
  return map;
}

TEST(Scene, ALineThatBeginsAndEndsInATunnelLiesInIt) {
  auto map = straight_line_of_5_km();
  map->landmarks = {{1, track::LandmarkKind::portal_in, 1, 100, 0, 0, ""},
                    {2, track::LandmarkKind::portal_out, 1, 4000, 0, 0, ""}};
  for (const char* start : {"1:2000:+", "1:2300:-"}) {
    const auto line = Line::make(map, map->parse_position(start).value(), 200).value();
    EXPECT_GT(line.depth_in_tunnel_m(0), 100) << start;
    EXPECT_GT(line.depth_in_tunnel_m(200), 100) << start;
  }
  const auto behind = Line::make(map, map->parse_position("1:4100:+").value(), 200).value();
  EXPECT_TRUE(behind.tunnels().empty());
  const auto leaves = Line::make(map, map->parse_position("1:3900:+").value(), 200).value();
  ASSERT_EQ(leaves.tunnels().size(), 1);
  EXPECT_DOUBLE_EQ(leaves.tunnels()[0].end_m, 100);
}

// The map does not say which is above.
TEST(Scene, WhatStandsBesideALineThatCrossesOnABridgeDoesNotStandBesideTheTrackBelow) {
  auto map = straight_line_of_5_km();
  map->edges.push_back({2, "above", 3, 4, "", track::Alignment::chained({-1000, 1050, core::kPi / 2}, {{2000, 0, 0}})});
  map->nodes.push_back({3, track::NodeKind::end, "", -1000, 1050});
  map->nodes.push_back({4, track::NodeKind::end, "", 1000, 1050});
  map->landmarks = {{1, track::LandmarkKind::mast, 1, 1040, 3, 0, ""},
                    {2, track::LandmarkKind::mast, 2, 997, 3, 0, ""}};
  const auto line = Line::make(map, map->parse_position("1:1000:+").value(), 200).value();
  EXPECT_EQ(line.masts().size(), 1);
}

}  // namespace
}  // namespace railfix::simulator
