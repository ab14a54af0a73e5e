#include "map/drawing.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <fstream>
#include <iterator>
#include <opencv2/imgcodecs.hpp>

#include "unit/track/small_map.hpp"

namespace railfix::tool {
namespace {

using testing::HasSubstr;

std::filesystem::path file_named(const std::string& name) {
  return std::filesystem::temp_directory_path() / ("railfix_drawing_" + std::to_string(::getpid()) + name);
}

TEST(Drawing, SvgShowsTracksSwitchesAndGroups) {
  track::Map map = track::small_map();
  map.nodes[1].name = "W<1>&";
  const auto file = file_named(".svg");
  ASSERT_TRUE(write_drawing(draw_map(map, {}), file).ok());
  std::ifstream in(file);
  const std::string text{std::istreambuf_iterator<char>(in), {}};
  EXPECT_THAT(text, HasSubstr("<svg"));
  EXPECT_THAT(text, HasSubstr("</svg>"));
  EXPECT_THAT(text, HasSubstr("W&lt;1&gt;&amp;"));
  EXPECT_THAT(text, HasSubstr("85/100"));
  EXPECT_THAT(text, HasSubstr("200 m"));  // the scale bar
  EXPECT_THAT(text, HasSubstr("bridge over"));
  EXPECT_THAT(text, HasSubstr("bridge under"));
  std::filesystem::remove(file);
}

TEST(Drawing, PngHasInkOnTheTrackAndNotBesideIt) {
  const auto file = file_named(".png");
  const Drawing drawing =
      draw_map(track::small_map(), {.width_px = 800, .around = track::EdgePosition{1, 500}, .radius_m = 100});
  ASSERT_TRUE(write_drawing(drawing, file).ok());
  const cv::Mat picture = cv::imread(file.string());
  ASSERT_EQ(picture.cols, 800);
  // Edge 1 runs east through the middle of the window.
  const int middle = 40 + 360;
  EXPECT_LT(picture.at<cv::Vec3b>(middle, 300)[0], 150);
  EXPECT_EQ(picture.at<cv::Vec3b>(middle - 100, 300)[0], 255);
  std::filesystem::remove(file);
}

TEST(Drawing, AFrogIsSeenFromNearBy) {
  track::Map map = track::small_map();
  map.landmarks = {{1, track::LandmarkKind::frog, 1, 500, 0, 0.1, ""}};
  const auto dots_of = [&](double radius_m, double width_px) {
    const auto at = track::EdgePosition{1, 500};
    return draw_map(map, {.width_px = width_px, .around = at, .radius_m = radius_m}).dots.size();
  };
  const size_t near = dots_of(100, 800);
  const size_t far = dots_of(5000, 400);
  map.landmarks.clear();
  EXPECT_EQ(near, dots_of(100, 800) + 1);
  EXPECT_EQ(far, dots_of(5000, 400));
}

/// Of all that is drawn.
Eigen::AlignedBox2d extent(const Drawing& drawing, size_t lines) {
  Eigen::AlignedBox2d box;
  for (size_t i = 0; i < lines; ++i) {
    for (const auto& point : drawing.lines.at(i).points) box.extend(point);
  }
  return box;
}

TEST(Drawing, TheWindowReachesNoFurtherThanTheMap) {
  const track::Map map = track::small_map();
  const auto drawing = draw_map(map, {.width_px = 800, .around = track::EdgePosition{1, 500}, .radius_m = 100'000});
  EXPECT_GT(extent(drawing, 3).sizes().x(), 0.4 * 800);
}

TEST(Drawing, TheLegendIsWithinNarrowPicturesToo) {
  for (const double width_px : {200.0, 400.0, 1600.0}) {
    const auto drawing = draw_map(track::small_map(), {.width_px = width_px});
    const auto last = std::ranges::find(drawing.labels, "level crossing", &Drawing::Label::text);
    ASSERT_NE(last, drawing.labels.end());
    for (const auto& label : drawing.labels) EXPECT_LT(label.at.y(), drawing.height) << width_px << label.text;
    EXPECT_LT(last->at.x() + 90, width_px);
  }
}

TEST(Drawing, FromNearByATrackHasItsNameAndTheScaleALength) {
  track::Map map = track::small_map();
  const auto& edge = map.edges.front();
  const auto drawing = draw_map(map, {.width_px = 1600, .around = track::EdgePosition{1, 100}, .radius_m = 1});
  const auto texts = [&](const std::string& text) {
    return std::ranges::count(drawing.labels, text, &Drawing::Label::text);
  };
  EXPECT_EQ(texts(edge.line.empty() ? edge.name : edge.line), 1);
  EXPECT_EQ(texts("0.2 m"), 1);
  EXPECT_EQ(texts("0 m"), 0);
  for (const auto& line : drawing.lines) {
    for (const auto& point : line.points)
      EXPECT_LT(point.cwiseAbs().maxCoeff(), 1e6) << "pictures have no further ones";
  }
}

TEST(Drawing, FromFarAwayMarksDoNotHideTheTracks) {
  track::Map map = track::small_map();
  map.edges.front().alignment = track::Alignment::chained({0, 0, 1}, {{300'000, 0, 0}});
  const auto drawing = draw_map(map, {});
  for (const auto& dot : drawing.dots) EXPECT_GT(dot.at.y(), drawing.height - 60) << "of the legend";
}

TEST(Drawing, TakesThePlaceOfTheOldOneAsAWhole) {
  const Drawing drawing = draw_map(track::small_map(), {});
  const std::filesystem::path folder = file_named("");
  std::filesystem::create_directories(folder);
  for (const char* name : {"a.svg", "a.png"}) {
    std::ofstream(folder / name) << "old";
    std::filesystem::create_hard_link(folder / name, folder / (std::string("kept") + name));
    ASSERT_TRUE(write_drawing(drawing, folder / name).ok());
    EXPECT_GT(std::filesystem::file_size(folder / name), 1000U);
    EXPECT_EQ(std::filesystem::file_size(folder / (std::string("kept") + name)), 3U) << "never half of the new one";
  }
  EXPECT_EQ(std::distance(std::filesystem::directory_iterator(folder), {}), 4) << "no draft is left";
  std::filesystem::remove_all(folder);
}

TEST(Drawing, NamesWhatIsWrong) {
  const Drawing drawing = draw_map(track::small_map(), {});
  EXPECT_THAT(write_drawing(drawing, "a.gif").error().message, HasSubstr(".svg or .png"));
  EXPECT_THAT(write_drawing(drawing, "/no/such/folder/a.png").error().message,
              HasSubstr("(No such file or directory); does its folder exist?"));
  EXPECT_THAT(write_drawing(drawing, "/no/such/folder/a.svg").error().message,
              HasSubstr("(No such file or directory); does its folder exist?"));
}

}  // namespace
}  // namespace railfix::tool
