// Each effect does what it says to the picture, and truth says whether the rails can be seen.
#include <gmock/gmock.h>

#include <cmath>

#include "scene.hpp"
#include "simulator/illumination.hpp"

namespace railfix::simulator::weather_test {
namespace {

// A picture without noise.
RenderOptions quiet_camera() {
  auto options = small_camera();
  options.read_noise_grey = 0.0;
  options.shot_noise_grey = 0.0;
  options.scenery = false;
  return options;
}

const Renderer& renderer() {
  static const Renderer one(line_from("1:100"), quiet_camera());
  return one;
}

cv::Mat picture_of(const Shot& shot) {
  return renderer().render(shot);
}

double mean_around(const cv::Mat& picture, const Shot& shot, double x_m, double y_m, int radius_px = 3) {
  const auto pixel = geometry::View(quiet_camera().camera, shot.pose).project({x_m, y_m, 0.0});
  const cv::Rect all(0, 0, picture.cols, picture.rows);
  const cv::Rect patch(static_cast<int>(pixel->x()) - radius_px, static_cast<int>(pixel->y()) - radius_px,
                       2 * radius_px + 1, 2 * radius_px + 1);
  return cv::mean(picture(patch & all))[0];
}

Shot sunny(double elevation_rad, double heading_rad) {
  auto shot = standing_at(20.0);
  shot.look.light.sky = 0.3;
  shot.look.light.sun = 0.7;
  shot.look.light.sun_elevation_rad = elevation_rad;
  shot.look.light.sun_heading_rad = heading_rad;
  return shot;
}

TEST(Weather, TheHeadlampLightsTheNearAndTheNightHidesTheFar) {
  auto shot = standing_at(20.0);
  shot.gain = 4.0;
  shot.look.light = {0.004, 0.008, 0.0, 0.5, 0.0, 1.0, 600.0};
  const cv::Mat night = picture_of(shot);
  const double near = mean_around(night, shot, 7.0, 0.0, 8);
  EXPECT_GT(near, 25.0);
  EXPECT_LT(mean_around(night, shot, 60.0, 0.0), 0.3 * near);
  EXPECT_LT(mean_around(night, shot, 9.0, 4.0), 0.6 * near);
  EXPECT_LT(cv::mean(night.rowRange(0, 60))[0], 10.0);
  EXPECT_GT(renderer().rails_visible(shot), 0.9);
  shot.look.light.headlamp = 0.0;
  EXPECT_EQ(renderer().rails_visible(shot), 0.0);
}

TEST(Weather, ShadowsDarkenTheGroundAndMove) {
  auto shot = sunny(0.5, 2.5);
  const cv::Mat sun = picture_of(shot);
  shot.look.shadows = 0.9;
  const cv::Mat shade = picture_of(shot);
  double least = 9.0;
  double most = 0.0;
  for (double x = 5.0; x < 40.0; x += 0.5) {
    const double ratio = mean_around(shade, shot, x, 0.0) / mean_around(sun, shot, x, 0.0);
    least = std::min(least, ratio);
    most = std::max(most, ratio);
  }
  EXPECT_NEAR(least, 1.0 - 0.9 * 0.7, 0.06);
  EXPECT_GT(most, 0.93);
  auto options = quiet_camera();
  options.weather.shadows.speed_mps = 5.0;
  const Renderer moving(line_from("1:100"), options);
  shot.look.time_s = 1.0;
  EXPECT_GT(cv::norm(moving.render(shot), shade, cv::NORM_L1) / static_cast<double>(shade.total()), 3.0);
  // Five metres in a second: what it shows there is what stood five metres back.
  const Illumination::Level level = Illumination(*line_from("1:100"), shot.look.light, 20.0).on_ground(10, 10, 0);
  EXPECT_NEAR(level.direct, 0.7F, 1e-6);
  const ShadowField field({3.0, 0.15, 0.6, 5.0}, 3);
  const auto early = field.slice(20.0, 0.0);
  const auto late = field.slice(20.0, 1.0);
  for (float s = 4.0F; s < 20.0F; s += 1.0F)
    EXPECT_NEAR(early.lit(s, 0.3F, 0.01F, 0.01F), late.lit(s + 5.0F, 0.3F, 0.01F, 0.01F), 1e-3);
}

TEST(Weather, ShadowsHaveNoSeam) {
  const ShadowField field({3.0, 0.3, 0.0, 0.0}, 3);
  const auto slice = field.slice(0.0, 0.0);
  float steepest = 0.0F;
  for (float d = -3.0F; d < 3.0F; d += 0.05F)
    for (float s = 0.0F; s < 60.0F; s += 1.7F)
      steepest = std::max(steepest, std::abs(slice.lit(s, d, 0.1F, 0.1F) - slice.lit(s, d + 0.05F, 0.1F, 0.1F)));
  EXPECT_LT(steepest, 0.45F);
}

TEST(Weather, TheSunAheadGlaresAndTheRailsMirrorIt) {
  const double ahead = line_from("1:100")->path().at(20.0).pose.heading_rad;
  const auto towards = sunny(0.12, ahead);
  const auto away = sunny(0.12, ahead + 3.14159);
  const cv::Mat glaring = picture_of(towards);
  const cv::Mat plain = picture_of(away);
  const geometry::View view(quiet_camera().camera, towards.pose);
  const auto sun = view.project({1000.0, 0.0, 1000.0 * std::tan(0.12)});
  EXPECT_EQ(glaring.at<uint8_t>(static_cast<int>(sun->y()), static_cast<int>(sun->x())), 255);
  EXPECT_GT(mean_around(glaring, towards, 12.0, 0.0), mean_around(plain, away, 12.0, 0.0) + 4.0);  // veil
  const double head = mean_around(glaring, towards, 10.0, 0.7475, 1) - mean_around(glaring, towards, 10.0, 0.0, 5);
  EXPECT_GT(head, 1.4 * (mean_around(plain, away, 10.0, 0.7475, 1) - mean_around(plain, away, 10.0, 0.0, 5)));
}

TEST(Weather, RainWetsTheGroundAndFallsThroughThePicture) {
  auto shot = standing_at(20.0);
  shot.speed_mps = 20.0;
  const cv::Mat dry = picture_of(shot);
  shot.look.wet = 1.0;
  const cv::Mat wet = picture_of(shot);
  EXPECT_LT(mean_around(wet, shot, 6.0, 0.3, 6), 0.7 * mean_around(dry, shot, 6.0, 0.3, 6));
  shot.look.rain = 1.0;
  const cv::Mat rain = picture_of(shot);
  EXPECT_GT(cv::countNonZero(rain > wet + 8), static_cast<int>(wet.total() / 400));
  shot.look.time_s = 0.02;
  EXPECT_GT(cv::norm(picture_of(shot), rain, cv::NORM_L1) / static_cast<double>(rain.total()), 0.3);
  shot.look = {};
  shot.look.leaves = 1.0;
  EXPECT_GT(cv::countNonZero(picture_of(shot) != dry), 100);
}

TEST(Windscreen, DirtStaysWhereItIs) {
  auto here = standing_at(20.0);
  auto there = standing_at(57.3);
  const cv::Mat clean_here = picture_of(here);
  const cv::Mat clean_there = picture_of(there);
  here.look.dirt = there.look.dirt = 1.0;
  const cv::Mat dirty_here = picture_of(here);
  const cv::Mat dirty_there = picture_of(there);
  const cv::Mat sky_here = clean_here.rowRange(0, 90) - dirty_here.rowRange(0, 90);
  const cv::Mat sky_there = clean_there.rowRange(0, 90) - dirty_there.rowRange(0, 90);
  EXPECT_GT(cv::countNonZero(sky_here > 20), 100);
  EXPECT_LT(cv::norm(sky_here, sky_there, cv::NORM_INF), 12.0);
}

TEST(Windscreen, TheWiperCrossesAndHidesTheRailsForAMoment) {
  auto options = quiet_camera();
  options.weather.glass.wiper_width = 0.12;
  const Renderer wide(line_from("1:100"), options);
  auto shot = standing_at(20.0);
  const cv::Mat clean = wide.render(shot);
  shot.look.wiping = true;
  double least = 1.0;
  int rests = 0;
  for (int k = 0; k < 60; ++k) {
    shot.look.time_s = k / 30.0;  // one period
    const double visible = wide.rails_visible(shot);
    rests += visible == 1.0;
    if (visible >= least) continue;
    least = visible;
    // What counts as hidden is dark in the picture.
    const cv::Mat wiped = wide.render(shot);
    EXPECT_GT(cv::countNonZero(wiped < 0.3 * clean), static_cast<int>(wiped.total() / 100));
  }
  EXPECT_LT(least, 0.75);
  EXPECT_GT(rests, 20);
}

TEST(Windscreen, DropsHideWhatIsBehindThemAndTheWiperTakesThem) {
  auto shot = standing_at(20.0);
  const cv::Mat clean = picture_of(shot);
  shot.look.drops = 1.0;
  shot.look.time_s = 31.0;
  const cv::Mat drops = picture_of(shot);
  const int many = cv::countNonZero(cv::abs(drops - clean) > 10);
  EXPECT_GT(many, static_cast<int>(clean.total() / 100));
  EXPECT_LT(renderer().rails_visible(shot), 1.0);
  shot.look.wiping = true;
  shot.look.time_s = 31.3;  // the blade has just been back: 30 + 1.2 s
  EXPECT_LT(cv::countNonZero(cv::abs(picture_of(shot) - clean) > 10), many / 3);
}

TEST(Visibility, IsOneByDayAndLessWhereThePictureIsWashedOut) {
  auto shot = standing_at(20.0);
  EXPECT_EQ(renderer().rails_visible(shot), 1.0);
  shot.gain = 40.0;  // everything is white
  EXPECT_EQ(renderer().rails_visible(shot), 0.0);
  shot.gain = 0.01;  // everything is black
  EXPECT_EQ(renderer().rails_visible(shot), 0.0);
}

}  // namespace
}  // namespace railfix::simulator::weather_test
