// The camera picture with what is drawn on it, the curvature seen, and the map as the page gets it.
#include <gtest/gtest.h>

#include "monitor/cab_view.hpp"
#include "monitor/cab_watch.hpp"
#include "monitor/map_api.hpp"

namespace railfix::monitor::cab_test {
namespace {

using track::EdgePosition;

constexpr int64_t kMs = 1'000'000;

CabWatch::Preview preview(int64_t stamp_ns) {
  auto made = std::make_shared<msg::CameraPreview>();
  made->stamp_ns(stamp_ns);
  made->width_px(320);
  made->height_px(256);
  return made;
}

messaging::SampleInfo at(int64_t arrived_ns) {
  messaging::SampleInfo info;
  info.arrived_ns = arrived_ns;
  return info;
}

msg::TrackView view(int64_t stamp_ns) {
  msg::TrackView made;
  made.stamp_ns(stamp_ns);
  made.height_m(2.5);
  made.pitch_rad(0.2);
  made.seen_left(1);
  made.seen_right(1);
  made.left_points(1);
  made.left_u_px()[0] = 200;
  made.left_v_px()[0] = 400;
  return made;
}

TEST(CabWatch, WaitsForWhatWasSeenInThePicture) {
  CabWatch cab(5);
  cab.picture("cam0", preview(1000), at(0));
  EXPECT_TRUE(cab.due(10 * kMs).empty());
  cab.track(view(900));
  EXPECT_TRUE(cab.due(20 * kMs).empty());
  cab.track(view(1000));
  const auto due = cab.due(30 * kMs);
  ASSERT_EQ(due.size(), 1U);
  ASSERT_TRUE(due[0].track);
  EXPECT_EQ(due[0].track->stamp_ns(), 1000);
  EXPECT_TRUE(cab.due(40 * kMs).empty());
}

TEST(CabWatch, ShowsThePictureWithoutWhenNothingWasSeenInIt) {
  CabWatch cab(5);
  cab.picture("cam0", preview(1000), at(0));
  cab.track(view(1100));
  ASSERT_EQ(cab.due(1).size(), 1U) << "the detector is beyond it";
  cab.picture("cam0", preview(2000), at(1000 * kMs));
  EXPECT_TRUE(cab.due(1100 * kMs).empty());
  const auto due = cab.due(1500 * kMs);
  ASSERT_EQ(due.size(), 1U);
  EXPECT_FALSE(due[0].track);
}

TEST(CabWatch, TakesNoMorePicturesThanTheRate) {
  CabWatch cab(5);
  int taken = 0;
  for (int i = 0; i < 100; ++i) {
    cab.picture("cam0", preview(i), at(i * 10 * kMs));
    cab.track(view(i));
    taken += static_cast<int>(cab.due(i * 10 * kMs).size());
  }
  EXPECT_GE(taken, 4);
  EXPECT_LE(taken, 6);
}

TEST(CurvatureTrail, KeepsTheLastMetresBehindTheTrain) {
  CurvatureTrail trail;
  for (int i = 0; i <= 1000; ++i) trail.add(i, 1e-3, 1e-5);
  const auto seen = trail.seen_from(1000);
  ASSERT_FALSE(seen.empty());
  EXPECT_DOUBLE_EQ(seen.back()[0], 0);
  EXPECT_DOUBLE_EQ(seen.front()[0], -CurvatureTrail::kLengthM);
  EXPECT_DOUBLE_EQ(seen.front()[1], 1e-3);
  trail.add(5000, 0, 0);
  EXPECT_EQ(trail.seen_from(5000).size(), 1U) << "another run";
  for (int i = 0; i < 100'000; ++i) trail.add(5000 + std::abs(i % 600 - 300), 0, 0);
  EXPECT_LE(trail.seen_from(5000).size(), CurvatureTrail::kLengthM) << "of a train that is moved to and fro";
}

class OnALine : public ::testing::Test {
 protected:
  // 500 m straight to the north, then a left arc of 500 m radius on a second edge.
  OnALine() {
    map_.nodes = {{1, track::NodeKind::end, "", 0, 0},
                  {2, track::NodeKind::railway_switch, "W1", 0, 500},
                  {3, track::NodeKind::end, "", 0, 0}};
    map_.edges = {{1, "a", 1, 2, "", track::Alignment::chained({0, 0, 0}, {{500, 0, 0}})},
                  {2, "b", 2, 3, "", track::Alignment::chained({0, 500, 0}, {{300, 0.002, 0.002}})}};
    map_.connections = {{2, 1, 2, false}};
    map_.landmarks = {{1, track::LandmarkKind::mast, 1, 480, 3.0, 0.1, "M1"},
                      {2, track::LandmarkKind::balise, 2, 20, 0, 0.1, "B1"}};
  }
  track::Map map_;
};

TEST_F(OnALine, TheMapHasPointsWhereTheLineBends) {
  const auto message = MapView(map_).message(std::nullopt, 0);
  ASSERT_EQ(message["edges"].size(), 2U);
  EXPECT_EQ(message["edges"][0]["line"].size(), 2U) << "a straight needs its ends";
  EXPECT_GE(message["edges"][1]["line"].size(), 16U);
  EXPECT_DOUBLE_EQ(message["edges"][1]["line"][3][4], 0.002);
  EXPECT_TRUE(message["edges"][0]["line"][0][3].is_null()) << "no height is known";
  EXPECT_DOUBLE_EQ(message["landmarks"][0]["easting_m"], -3) << "3 m left of a track to the north";
  EXPECT_EQ(message["switches"][0]["offset_m"], 500);
  EXPECT_EQ(MapView(map_).message(EdgePosition{1, 0}, 100)["edges"].size(), 1U) << "the second begins 500 m away";
}

Request part(const std::map<std::string, std::string>& query) {
  Request request;
  request.query = query;
  return request;
}

TEST_F(OnALine, TheMapIsMadeOnceForAllWhoAskForTheSamePart) {
  const MapView view(map_);
  MapApi api(map_, view);
  const auto all = api.get(part({}), std::nullopt).shared;
  EXPECT_EQ(nlohmann::json::parse(*all)["edges"].size(), 2U);
  EXPECT_EQ(api.get(part({}), EdgePosition{1, 7}).shared, all) << "a short map is given as a whole";
  const auto near = api.get(part({{"edge", "1"}, {"radius", "100"}}), std::nullopt).shared;
  EXPECT_EQ(nlohmann::json::parse(*near)["edges"].size(), 1U);
  EXPECT_EQ(api.get(part({{"edge", "1"}, {"radius", "100"}}), std::nullopt).shared, near);
  EXPECT_NE(api.get(part({{"edge", "2"}, {"radius", "100"}}), std::nullopt).shared, near);
  EXPECT_EQ(*api.get(part({}), std::nullopt).shared, *all);
}

TEST_F(OnALine, NoMoreOfTheMapIsGivenThanAPageCanUse) {
  const MapView view(map_);
  MapApi api(map_, view);
  const auto refused = api.get(part({{"edge", "1"}, {"radius", "1e9"}}), std::nullopt);
  EXPECT_EQ(refused.status, 400U);
  EXPECT_EQ(refused.body, "radius must be 50000 m or less; without it 20000 m are given\n");
  for (const std::string odd : {"-1e300", "1e300", "nan", "inf", "x", "-1", "0", "3"}) {
    for (const std::string key : {"edge", "offset"}) {
      auto request = part({{"edge", "1"}, {"radius", "50000"}});
      request.query[key] = odd;
      EXPECT_EQ(api.get(request, std::nullopt).status, 200U) << key << "=" << odd;
    }
  }
}

TEST_F(OnALine, CurvatureAndLandmarksAreThoseOfTheWayAhead) {
  const MapView view(map_);
  const auto profile = view.curvature(EdgePosition{1, 450, track::Direction::forward}, 100, 100);
  EXPECT_DOUBLE_EQ(profile.front()[0], -100);
  for (const auto& point : profile) {
    if (point[0] == 40) {
      EXPECT_DOUBLE_EQ(point[1], 0);
    }
    if (point[0] == 60) {
      EXPECT_DOUBLE_EQ(point[1], 0.002);
    }
  }
  const auto ahead = view.landmarks_ahead(EdgePosition{1, 450, track::Direction::forward}, 100);
  ASSERT_EQ(ahead.size(), 2U);
  EXPECT_DOUBLE_EQ(ahead[0].ahead_m, 30);
  EXPECT_DOUBLE_EQ(ahead[1].ahead_m, 70);
  EXPECT_NEAR(view.bend_m(EdgePosition{2, 0, track::Direction::forward}, 100), 10, 0.05) << "100^2 / (2 * 500)";
  const auto back = view.landmarks_ahead(EdgePosition{1, 490, track::Direction::reverse}, 100);
  ASSERT_EQ(back.size(), 1U);
  EXPECT_DOUBLE_EQ(back[0].ahead_m, 10);
  EXPECT_DOUBLE_EQ(back[0].across_m, -3) << "on the right of who looks back";
}

TEST_F(OnALine, APortalThatLeadsInIsOneThatLeadsOutTheOtherWay) {
  map_.landmarks.push_back({9, track::LandmarkKind::portal_in, 1, 300, 0, 0.1, ""});
  const MapView view(map_);
  EXPECT_EQ(view.landmarks_ahead({1, 250, track::Direction::forward}, 100).at(0).kind, track::LandmarkKind::portal_in);
  EXPECT_EQ(view.landmarks_ahead({1, 350, track::Direction::reverse}, 100).at(0).kind, track::LandmarkKind::portal_out);
}

TEST_F(OnALine, DrawsInPixelsOfThePreview) {
  const MapView map(map_);
  const geometry::Intrinsics camera{800, 800, 320, 256, 0, 0, 0, 0, 640, 512};
  const auto seen = view(5);
  const auto message = view_message({"cam0", 5, 320, 256, msg::PICTURE_DARK | msg::PICTURE_BLURRED, &seen, &camera,
                                     &map, EdgePosition{1, 450, track::Direction::forward}});
  EXPECT_EQ(message["rails"]["left"][0], nlohmann::json({100, 200}));
  EXPECT_TRUE(message["seen"]);
  EXPECT_EQ(message["health"], nlohmann::json({"dark", "blurred"}));
  ASSERT_EQ(message["landmarks"].size(), 2U);
  EXPECT_LT(message["landmarks"][0]["x"], 160) << "the mast stands left";
  EXPECT_EQ(message["landmarks"][0]["side"], "left");

  const auto none = view_message({"cam0", 5, 320, 256, 0, nullptr, &camera, &map, std::nullopt});
  EXPECT_TRUE(none["rails"].is_null());
  EXPECT_FALSE(none["seen"]);
  EXPECT_EQ(none["why"], "no answer of the track detector for this picture");
}

}  // namespace
}  // namespace railfix::monitor::cab_test
