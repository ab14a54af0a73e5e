// In steady state the mouse takes no memory: neither by operator new nor for matrices of OpenCV.
#include <gtest/gtest.h>

#include <algorithm>

#include "core/time.hpp"
#include "odometry/train_mouse.hpp"
#include "support/count_allocations.hpp"
#include "unit/odometry/synthetic_ground.hpp"

namespace railfix::odometry {
namespace {

TEST(TrainMouse, TakesNoMemoryInSteadyState) {
  const railfix::test::CountMatrices matrices;
  test::SyntheticGround ground(3, {});
  TrainMouse mouse(test::small_camera(), {});
  MousePicture picture;
  picture.pose_measured = true;
  double distance_m = 0;
  for (int i = 0; i < 45; ++i) {  // runs, brakes, stands
    distance_m += std::clamp(0.02 * (32 - i), 0.0, 0.3);
    picture.pose = test::cab_mount();
    picture.grey = ground.picture(test::small_camera(), picture.pose, distance_m, {});
    picture.stamp_ns = core::to_ns(1 + i / 30.0);
    railfix::test::counting = i > 8;
    const MouseStep step = mouse.process(picture);
    railfix::test::counting = false;
    EXPECT_TRUE(step.valid || i < 3);
  }
  EXPECT_EQ(railfix::test::allocations, 0);
}

}  // namespace
}  // namespace railfix::odometry
