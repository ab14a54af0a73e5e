// A GenICam camera that Aravis makes up inside this process.
#include <gmock/gmock.h>

#include <atomic>

#include "core/time.hpp"
#include "frame_grabber/live_camera.hpp"

namespace {

std::atomic<double> exposure_us = 4000;

}  // namespace

extern "C" {
void arv_enable_interface(const char* interface);
/// In place of Aravis's own, whose made-up camera has no light.
double arv_camera_get_exposure_time(void* /*camera*/, void* /*error*/) {
  return exposure_us;
}
}

namespace railfix::frame_grabber {
namespace {

class GenicamCameraTest : public ::testing::Test {
 protected:
  GenicamCameraTest() {
    arv_enable_interface("Fake");
    config_.rate_hz = 50;
  }
  void connect() {
    camera_ = make_genicam_camera("Fake_1", config_);
    const auto connected = camera_->connect();
    ASSERT_TRUE(connected.ok()) << connected.error().message;
  }
  RawPicture picture() {
    const int64_t deadline_ns = core::monotonic_ns() + 10 * core::kNsPerSecond;
    while (core::monotonic_ns() < deadline_ns) {
      auto next = camera_->next(std::chrono::milliseconds(100));
      EXPECT_TRUE(next.ok());
      if (next.ok() && next.value()) return std::move(*std::move(next).value());
    }
    ADD_FAILURE() << "no picture";
    return {};
  }
  LiveConfig config_;
  std::unique_ptr<LiveCamera> camera_;
};

TEST_F(GenicamCameraTest, AnAutomaticExposureIsFollowed) {
  exposure_us = 4000;
  connect();
  EXPECT_NEAR(picture().exposure_s, 0.004, 1e-7);
  exposure_us = 400;
  const int64_t changed_ns = core::monotonic_ns();
  while (std::abs(picture().exposure_s - 0.0004) > 1e-7) {
    ASSERT_LT(core::monotonic_ns() - changed_ns, 5 * core::kNsPerSecond) << "it is still that of the day";
  }
}

TEST_F(GenicamCameraTest, WidthAndHeightAreSetEachAlone) {
  connect();
  const cv::Size whole = picture().size;
  config_.width_px = whole.width / 2;
  camera_.reset();
  connect();
  EXPECT_EQ(picture().size, cv::Size(whole.width / 2, whole.height));
  config_.width_px = 0;
  config_.height_px = whole.height / 2;
  camera_.reset();
  connect();
  EXPECT_EQ(picture().size, cv::Size(whole.width, whole.height / 2));
}

TEST_F(GenicamCameraTest, ACameraWithoutPtpSaysThatItsStampsAreOfTheArrival) {
  connect();
  EXPECT_FALSE(picture().no_host_time) << "nobody has asked for it";
  config_.ptp = true;
  camera_.reset();
  connect();
  EXPECT_TRUE(picture().no_host_time);
}

}  // namespace
}  // namespace railfix::frame_grabber
