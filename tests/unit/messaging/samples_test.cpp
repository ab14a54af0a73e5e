// What a sample means, or that it means nothing.
#include "messaging/samples.hpp"

#include <gtest/gtest.h>

#include <limits>

#include "messaging/camera.hpp"

namespace railfix::messaging {
namespace {

constexpr double kNoNumber = std::numeric_limits<double>::quiet_NaN();

msg::TrackView seen_view() {
  msg::TrackView view;
  view.seen_left(1);
  view.height_m(2.5);
  view.covariance().fill(1e-4);
  return view;
}

// One such view made odometry blind for ever.
TEST(Samples, AViewThatIsNotANumberAnywhereHasSeenNothing) {
  ASSERT_TRUE(has_seen(seen_view()));
  using Set = void (msg::TrackView::*)(double);
  for (const Set set : {Set(&msg::TrackView::roll_rad), Set(&msg::TrackView::pitch_rad), Set(&msg::TrackView::yaw_rad),
                        Set(&msg::TrackView::lateral_m), Set(&msg::TrackView::height_m),
                        Set(&msg::TrackView::curvature_per_m), Set(&msg::TrackView::vertical_curvature_per_m)}) {
    auto view = seen_view();
    (view.*set)(kNoNumber);
    EXPECT_FALSE(has_seen(view));
    (view.*set)(std::numeric_limits<double>::infinity());
    EXPECT_FALSE(has_seen(view));
  }
  auto view = seen_view();
  view.covariance()[kCurvatureVariance] = kNoNumber;
  EXPECT_FALSE(has_seen(view));
  view = seen_view();
  view.seen_left(0);
  EXPECT_FALSE(has_seen(view));
}

msg::CameraCalibration usual_calibration() {
  msg::CameraCalibration c;
  c.width_px(1280);
  c.height_px(1024);
  c.fu_px(1150);
  c.fv_px(1150);
  c.cu_px(639.5);
  c.cv_px(511.5);
  c.pitch_rad(0.1);
  c.height_m(2.6);
  return c;
}

TEST(Samples, ACalibrationThatNoCameraHasIsUnusable) {
  ASSERT_EQ(why_unusable(usual_calibration()), nullptr);
  using Set = void (msg::CameraCalibration::*)(double);
  using C = msg::CameraCalibration;
  for (const Set set :
       {Set(&C::fu_px), Set(&C::fv_px), Set(&C::cu_px), Set(&C::cv_px), Set(&C::k1), Set(&C::k2), Set(&C::p1),
        Set(&C::p2), Set(&C::roll_rad), Set(&C::pitch_rad), Set(&C::yaw_rad), Set(&C::lateral_m), Set(&C::height_m)}) {
    auto c = usual_calibration();
    (c.*set)(kNoNumber);
    EXPECT_NE(why_unusable(c), nullptr);
  }
  const auto with = [](Set set, double value) {
    auto c = usual_calibration();
    (c.*set)(value);
    return why_unusable(c);
  };
  EXPECT_NE(with(&C::height_m, 0), nullptr);
  EXPECT_NE(with(&C::height_m, 25), nullptr);
  EXPECT_NE(with(&C::fu_px, 0), nullptr);
  EXPECT_NE(with(&C::fv_px, 1e9), nullptr);
  EXPECT_NE(with(&C::pitch_rad, 1.57), nullptr);
  EXPECT_NE(with(&C::lateral_m, -50), nullptr);
}

}  // namespace
}  // namespace railfix::messaging
