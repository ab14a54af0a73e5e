// In steady state neither the rails nor the sightings take memory: neither by operator new nor for matrices of OpenCV.
#include <gtest/gtest.h>

#include <cmath>

#include "core/time.hpp"
#include "simulator/builtin_line.hpp"
#include "simulator/renderer.hpp"
#include "support/count_allocations.hpp"
#include "track_detector/landmark_finder.hpp"
#include "track_detector/track_detector.hpp"

namespace railfix::track_detector {
namespace {

constexpr int kWarmUp = 12;

/// A ride over two balises and a frog of the built-in line.
class SteadyState : public ::testing::Test {
 protected:
  SteadyState() {
    auto& camera = options_.camera;
    camera.width_px = 640;
    camera.height_px = 512;
    camera.fu_px = camera.fv_px = 576;
    camera.cu_px = 319.5;
    camera.cv_px = 255.5;
    mount_.height_m = 2.5;
    mount_.pitch_rad = 0.21;
    auto map = std::make_shared<track::Map>(simulator::builtin_line());
    auto line = simulator::Line::make(map, {1, kBeginM, track::Direction::forward}, 140);
    renderer_ =
        std::make_unique<simulator::Renderer>(std::make_shared<simulator::Line>(std::move(line).value()), options_);
    test::allocations = 0;
  }

  cv::Mat picture(int index) {
    simulator::Shot shot;
    shot.pose = mount_;
    shot.distance_m = kStepM * index;
    shot.speed_mps = kStepM * 30;
    return renderer_->render(shot);
  }

  static constexpr double kBeginM = 1296;
  static constexpr double kStepM = 0.9;
  test::CountMatrices matrices_;
  simulator::RenderOptions options_;
  geometry::CameraPose mount_;
  std::unique_ptr<simulator::Renderer> renderer_;
};

TEST_F(SteadyState, RailsAndSightingsTakeNoMemory) {
  TrackDetector detector(options_.camera, mount_, {});
  LandmarkFinder finder(options_.camera, {});
  size_t sighted = 0;
  for (int i = 0; i < 100; ++i) {
    LandmarkPicture one;
    one.grey = picture(i);
    one.stamp_ns = core::to_ns(1 + i / 30.0);
    test::counting = i >= kWarmUp;
    const TrackObservation& rails = detector.detect(one.grey);
    one.pose = rails.shape.camera;
    one.pitch_sigma_rad = std::sqrt(rails.covariance(1, 1));
    one.curvature_per_m = rails.shape.curvature_per_m;
    const auto& sightings = finder.process(one);
    test::counting = false;
    EXPECT_TRUE(rails.seen()) << i << " " << rails.reason;
    sighted += sightings.size();
  }
  EXPECT_GE(sighted, 3U);
  EXPECT_EQ(test::allocations, 0);
}

TEST_F(SteadyState, SearchingWithoutRailsTakesNoMemory) {
  TrackDetector detector(options_.camera, mount_, {});
  cv::Mat upside_down;
  cv::flip(picture(0), upside_down, 0);
  for (int i = 0; i < 12; ++i) {
    test::counting = i >= 4;
    const bool seen = detector.detect(upside_down).seen();
    test::counting = false;
    EXPECT_FALSE(seen);
  }
  EXPECT_EQ(test::allocations, 0);
}

}  // namespace
}  // namespace railfix::track_detector
