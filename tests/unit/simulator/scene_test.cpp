// Switches, neighbouring tracks and things beside the path are where the truth says.
#include <gmock/gmock.h>

#include <algorithm>
#include <cmath>
#include <numeric>

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

}  // namespace
}  // namespace railfix::simulator
