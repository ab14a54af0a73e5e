#include "map/drawing.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

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
  const auto dots_of = [&](double radius_m) {
    return draw_map(map, {.width_px = 800, .around = track::EdgePosition{1, 500}, .radius_m = radius_m}).dots.size();
  };
  const size_t near = dots_of(100);
  const size_t far = dots_of(5000);
  map.landmarks.clear();
  EXPECT_EQ(near, dots_of(100) + 1);
  EXPECT_EQ(far, dots_of(5000));
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
