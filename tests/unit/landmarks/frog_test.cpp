#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "core/time.hpp"
#include "simulator/builtin_line.hpp"
#include "simulator/renderer.hpp"
#include "support/turnout.hpp"
#include "track_detector/landmark_finder.hpp"

namespace railfix::track_detector {
namespace {

struct Seen {
  double error_m = 0;
  Sighting sighting;
};

// Drives over the first frog behind `start`.
std::vector<Seen> frogs_from(const track::Map& on, const track::EdgePosition& start, double pitch_rad = 0.21) {
  auto map = std::make_shared<track::Map>(on);
  auto line = simulator::Line::make(map, start, 60);
  if (!line.ok()) return {};
  double frog_m = 0;
  for (const auto& mark : line.value().path().landmarks()) {
    if (mark.kind == track::LandmarkKind::frog && mark.distance_m > 25 && frog_m == 0) frog_m = mark.distance_m;
  }
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
  picture.pose.pitch_rad = pitch_rad;
  std::vector<Seen> seen;
  for (double at_m = frog_m - 18; at_m < frog_m - 5; at_m += 0.75) {
    simulator::Shot shot;
    shot.pose = picture.pose;
    shot.distance_m = at_m;
    shot.speed_mps = 22.5;
    picture.grey = renderer.render(shot);
    for (const Sighting& sighting : finder.process(picture)) {
      if (sighting.type == LandmarkType::frog) seen.push_back({at_m + sighting.distance_ahead_m - frog_m, sighting});
    }
    picture.stamp_ns += core::to_ns(1.0 / 30);
  }
  return seen;
}

// The built-in line's first switch, which the train meets at the blades.
TEST(Frogs, AFrogIsReportedOnceAndWhereItLies) {
  const auto seen = frogs_from(simulator::builtin_line(), {1, 1370, track::Direction::forward});
  ASSERT_EQ(seen.size(), 1U);
  EXPECT_GT(seen[0].sighting.lateral_m, 0.5);  // the branch leaves to the left
  EXPECT_LT(std::abs(seen[0].error_m), 3 * seen[0].sighting.sigma_m);
  EXPECT_NEAR(seen[0].error_m, 0, 0.04);
}

// From the other side the crossing rail runs across the line of sight and shows its flank.
TEST(Frogs, OneThatIsMetFromBehindLiesWhereItLies) {
  const auto seen = frogs_from(simulator::builtin_line(), {2, 80, track::Direction::reverse});
  ASSERT_EQ(seen.size(), 1U);
  EXPECT_NEAR(seen[0].error_m, 0, 0.04);
}

// The other rail runs between ours for 9 m before the crossing, which a camera that looks far ahead does not see whole.
TEST(Frogs, ThoseOfFlatTurnoutsAreReportedByACameraThatLooksFarAhead) {
  for (const double radius_m : {760, 1200}) {
    const track::Map map = testing::turnout(radius_m);
    const double frog_m = map.landmarks.front().offset_m;
    for (const track::EdgePosition& start :
         {track::EdgePosition{1, testing::kTurnoutStemM - 20, track::Direction::forward},
          track::EdgePosition{2, frog_m + 30, track::Direction::reverse}}) {
      const auto seen = frogs_from(map, start, 0.14);
      ASSERT_EQ(seen.size(), 1U) << radius_m << ", edge " << start.edge;
      EXPECT_LT(std::abs(seen[0].error_m), 2 * seen[0].sighting.sigma_m) << radius_m;
      EXPECT_LT(seen[0].sighting.sigma_m, 0.15) << radius_m;
    }
  }
}

}  // namespace
}  // namespace railfix::track_detector
