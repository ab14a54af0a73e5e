#include <gtest/gtest.h>

#include <cmath>

#include "core/time.hpp"
#include "simulator/builtin_line.hpp"
#include "simulator/renderer.hpp"
#include "track_detector/landmark_finder.hpp"

namespace railfix::track_detector {
namespace {

// The built-in line's first switch, which the train meets at the blades.
TEST(Frogs, AFrogIsReportedOnceAndWhereItLies) {
  auto map = std::make_shared<track::Map>(simulator::builtin_line());
  constexpr double kBeginM = 1370;
  auto line = simulator::Line::make(map, {1, kBeginM, track::Direction::forward}, 60);
  ASSERT_TRUE(line.ok());
  double frog_m = 0;
  for (const auto& mark : line.value().path().landmarks()) {
    if (mark.kind == track::LandmarkKind::frog && frog_m == 0) frog_m = mark.distance_m;
  }
  ASSERT_GT(frog_m, 25);
  simulator::RenderOptions options;
  auto& camera = options.camera;
  camera.width_px = 640;
  camera.height_px = 512;
  camera.fu_px = camera.fv_px = 576;
  camera.cu_px = 319.5;
  camera.cv_px = 255.5;
  options.scenery = false;
  const simulator::Renderer renderer(std::make_shared<simulator::Line>(std::move(line).value()), options);
  LandmarkFinder finder(camera, {});
  LandmarkPicture picture;
  picture.pose.height_m = 2.5;
  picture.pose.pitch_rad = 0.21;
  std::vector<double> places_m;
  for (double at_m = frog_m - 18; at_m < frog_m - 5; at_m += 0.75) {
    simulator::Shot shot;
    shot.pose = picture.pose;
    shot.distance_m = at_m;
    shot.speed_mps = 22.5;
    picture.grey = renderer.render(shot);
    for (const Sighting& sighting : finder.process(picture)) {
      if (sighting.type != LandmarkType::frog) continue;
      places_m.push_back(at_m + sighting.distance_ahead_m);
      EXPECT_GT(sighting.lateral_m, 0.5);  // the branch leaves to the left
      EXPECT_LT(std::abs(places_m.back() - frog_m), 3 * sighting.sigma_m);
    }
    picture.stamp_ns += core::to_ns(1.0 / 30);
  }
  ASSERT_EQ(places_m.size(), 1U);
  EXPECT_NEAR(places_m[0], frog_m, 0.3);
}

}  // namespace
}  // namespace railfix::track_detector
