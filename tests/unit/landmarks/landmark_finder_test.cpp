#include "track_detector/landmark_finder.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <opencv2/imgproc.hpp>

#include "core/random.hpp"
#include "core/time.hpp"

namespace railfix::track_detector {
namespace {

geometry::Intrinsics camera() {
  geometry::Intrinsics c;
  c.fu_px = c.fv_px = 576;
  c.cu_px = 320;
  c.cv_px = 256;
  c.width_px = 640;
  c.height_px = 512;
  return c;
}

geometry::CameraPose mount() {
  geometry::CameraPose pose;
  pose.pitch_rad = 0.21;
  pose.height_m = 2.5;
  return pose;
}

// Noisy ballast with sleepers, and one plate in it.
class Scene {
 public:
  double plate_m = 30;
  double plate_width_m = 0.48;
  double plate_lateral_m = 0;

  cv::Mat picture(double distance_m) {
    cv::Mat grey(camera().height_px, camera().width_px, CV_8UC1);
    for (int v = 0; v < grey.rows; ++v) {
      for (int u = 0; u < grey.cols; ++u) grey.at<uchar>(v, u) = static_cast<uchar>(80 + 12 * random_.uniform());
    }
    for (auto k = static_cast<int64_t>(distance_m / kStoneM); static_cast<double>(k) * kStoneM < distance_m + 15; ++k) {
      core::Random stones(static_cast<uint64_t>(k));
      for (int column = -3; column < 3; ++column) {
        const double s = static_cast<double>(k) * kStoneM;
        paint(grey, {s - distance_m, kStoneM, 0.2, 0.2 * column + 0.1, 0.18}, 75 + 25 * stones.uniform());
      }
    }
    for (double s = std::floor(distance_m / 0.6) * 0.6; s < distance_m + 30; s += 0.6) {
      paint(grey, {s - distance_m, 0.27, 2.6, 0.0, 0.18}, 115);
    }
    paint(grey, {plate_m - distance_m, 0.36, plate_width_m, plate_lateral_m, 0.12}, 170);
    cv::GaussianBlur(grey, grey, cv::Size(3, 3), 0.8);
    return grey;
  }

 private:
  static constexpr double kStoneM = 0.15;
  struct Area {
    double ahead_m, length_m, width_m, lateral_m, depth_m;
  };
  static void paint(cv::Mat& grey, const Area& area, double value) {
    const geometry::View view(camera(), mount());
    std::vector<cv::Point> corners;
    for (const auto& [x, y] : {std::pair{-0.5, -0.5}, {-0.5, 0.5}, {0.5, 0.5}, {0.5, -0.5}}) {
      const double ahead_m = area.ahead_m + x * area.length_m;
      if (ahead_m < 2.5) return;
      const auto pixel = view.project({ahead_m, area.lateral_m + y * area.width_m, -area.depth_m});
      if (!pixel) return;
      corners.emplace_back(static_cast<int>(std::lround(pixel->x() * 16)),
                           static_cast<int>(std::lround(pixel->y() * 16)));
    }
    cv::fillConvexPoly(grey, corners, cv::Scalar(value), cv::LINE_AA, 4);
  }
  core::Random random_{4};
};

struct Place {
  double distance_m;
  Sighting sighting;
};

std::vector<Place> ride(Scene& scene, double speed_mps, double to_m, double sigma_factor = 1) {
  LandmarkFinder finder(camera(), {});
  std::vector<Place> places;
  constexpr double kRate = 30.0;
  for (int i = 0; 10.0 + i * speed_mps / kRate < to_m; ++i) {
    LandmarkPicture picture;
    picture.grey = scene.picture(10.0 + i * speed_mps / kRate);
    picture.stamp_ns = core::to_ns(i / kRate);
    picture.pose = mount();
    picture.sigma_factor = sigma_factor;
    for (const Sighting& sighting : finder.process(picture)) {
      places.push_back({10.0 + speed_mps * core::seconds(sighting.stamp_ns) + sighting.distance_ahead_m, sighting});
    }
  }
  return places;
}

TEST(LandmarkFinder, ReportsABaliseOnceAndWhereItLies) {
  Scene scene;
  const auto places = ride(scene, 9.0, 30.0);
  ASSERT_EQ(places.size(), 1U);
  EXPECT_NEAR(places[0].distance_m, 30.0, 0.05);
  EXPECT_NEAR(places[0].sighting.lateral_m, 0.0, 0.03);
  EXPECT_LT(std::abs(places[0].distance_m - 30.0), 2.5 * places[0].sighting.sigma_m);
}

// Over crossing panels or snow all that stands beside the track is off the same way.
TEST(LandmarkFinder, DoubtsTheWayByTheGroundThatItWasMeasuredOn) {
  const double panels = (0.19 - 0.02) / (2.5 + 0.19);  // a crossing, 2 cm below the rail heads
  EXPECT_LT(panels, 3 * way_past_sigma({}, 2.5));
  LandmarkOptions known;
  known.texture_depth_sigma_m = 0;
  EXPECT_EQ(way_past_sigma(known, 2.5), known.way_sigma);
}

TEST(LandmarkFinder, DoubtsWhatWasSeenBadly) {
  Scene scene;
  Scene same;
  const auto well = ride(scene, 9, 30);
  const auto badly = ride(same, 9, 30, 2.5);
  ASSERT_EQ(well.size(), 1U);
  ASSERT_EQ(badly.size(), 1U);
  EXPECT_NEAR(badly[0].sighting.sigma_m, 2.5 * well[0].sighting.sigma_m, 1e-9);
}

TEST(LandmarkFinder, FindsABaliseAtLineSpeed) {
  Scene scene;
  const auto places = ride(scene, 33.0, 32.0);
  ASSERT_EQ(places.size(), 1U);
  EXPECT_NEAR(places[0].distance_m, 30.0, 0.1);
}

TEST(LandmarkFinder, SleepersAreNoBalises) {
  Scene scene;
  scene.plate_m = 1000;
  EXPECT_TRUE(ride(scene, 9.0, 40.0).empty());
}

TEST(LandmarkFinder, PlatesOfOtherSizeOrPlaceAreNoBalises) {
  Scene wide;
  wide.plate_width_m = 0.9;
  EXPECT_TRUE(ride(wide, 9.0, 30.0).empty());
  Scene aside;
  aside.plate_lateral_m = 0.4;
  EXPECT_TRUE(ride(aside, 9.0, 30.0).empty());
}

TEST(LandmarkFinder, StandingInFrontOfABaliseReportsNothing) {
  Scene scene;
  LandmarkFinder finder(camera(), {});
  for (int i = 0; i < 30; ++i) {
    LandmarkPicture picture;
    picture.grey = scene.picture(22.0);
    picture.stamp_ns = core::to_ns(i / 30.0);
    picture.pose = mount();
    EXPECT_TRUE(finder.process(picture).empty());
  }
}

}  // namespace
}  // namespace railfix::track_detector
