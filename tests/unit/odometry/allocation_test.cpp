// In steady state the mouse takes no memory: neither by operator new nor for matrices of OpenCV.
#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <cstdlib>
#include <new>

#include "core/time.hpp"
#include "odometry/train_mouse.hpp"
#include "unit/odometry/synthetic_ground.hpp"

namespace {

std::atomic<bool> counting = false;
std::atomic<int> allocations = 0;

class CountingMatAllocator : public cv::MatAllocator {
 public:
  cv::UMatData* allocate(int dims, const int* sizes, int type, void* data, size_t* step, cv::AccessFlag flags,
                         cv::UMatUsageFlags usage) const override {
    if (counting) ++allocations;
    return cv::Mat::getStdAllocator()->allocate(dims, sizes, type, data, step, flags, usage);
  }
  bool allocate(cv::UMatData* data, cv::AccessFlag flags, cv::UMatUsageFlags usage) const override {
    return cv::Mat::getStdAllocator()->allocate(data, flags, usage);
  }
  void deallocate(cv::UMatData* data) const override { cv::Mat::getStdAllocator()->deallocate(data); }
};

}  // namespace

void* operator new(size_t size) {
  if (counting) ++allocations;
  if (void* memory = std::malloc(size == 0 ? 1 : size)) return memory;
  throw std::bad_alloc();
}
void operator delete(void* memory) noexcept {
  std::free(memory);
}
void operator delete(void* memory, size_t) noexcept {
  std::free(memory);
}

namespace railfix::odometry {
namespace {

TEST(TrainMouse, TakesNoMemoryInSteadyState) {
  static CountingMatAllocator allocator;
  cv::Mat::setDefaultAllocator(&allocator);
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
    counting = i > 8;
    const MouseStep step = mouse.process(picture);
    counting = false;
    EXPECT_TRUE(step.valid || i < 3);
  }
  cv::Mat::setDefaultAllocator(nullptr);
  EXPECT_EQ(allocations, 0);
}

}  // namespace
}  // namespace railfix::odometry
