// A GenICam camera that Aravis makes up inside this process.
#include <dlfcn.h>
#include <gmock/gmock.h>

#include <atomic>
#include <thread>

#include "core/time.hpp"
#include "frame_grabber/live_camera.hpp"

namespace {

std::atomic<double> exposure_us = 4000;
std::atomic<bool> answers = true;  // when it is asked for its exposure
std::atomic<int> asked = 0;
std::atomic<bool> sends = true;
std::atomic<bool> cuts = false;  // its pictures

/// Aravis's own, where one of the same name stands in front of it.
template <class Function>
Function aravis(const char* name) {
  return reinterpret_cast<Function>(dlsym(RTLD_NEXT, name));
}

}  // namespace

extern "C" {
void arv_enable_interface(const char* interface);
void g_set_error_literal(void* error, uint32_t domain, int code, const char* message);
uint32_t g_quark_from_string(const char* string);
/// In place of Aravis's own, whose made-up camera has no light.
double arv_camera_get_exposure_time(void* /*camera*/, void* error) {
  ++asked;
  if (answers) return exposure_us;
  g_set_error_literal(error, g_quark_from_string("test"), 1, "timeout");
  return 0;
}
void* arv_stream_timeout_pop_buffer(void* stream, uint64_t timeout_us) {
  if (sends)
    return aravis<decltype(&arv_stream_timeout_pop_buffer)>("arv_stream_timeout_pop_buffer")(stream, timeout_us);
  std::this_thread::sleep_for(std::chrono::microseconds(timeout_us));
  return nullptr;
}
int arv_buffer_get_status(void* buffer) {
  constexpr int kMissingPackets = 5;
  return cuts ? kMissingPackets : aravis<decltype(&arv_buffer_get_status)>("arv_buffer_get_status")(buffer);
}
}

namespace railfix::frame_grabber {
namespace {

class GenicamCameraTest : public ::testing::Test {
 protected:
  GenicamCameraTest() {
    arv_enable_interface("Fake");
    config_.rate_hz = 50;
    answers = sends = true;
    cuts = false;
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
  void wait_s(double s) {
    for (const int64_t from_ns = core::monotonic_ns(); core::seconds(core::monotonic_ns() - from_ns) < s;)
      (void)camera_->next(std::chrono::milliseconds(20));
  }
  void cut_a_picture() {
    (void)camera_->take_lost();
    cuts = true;
    while (camera_->take_lost() == 0) (void)camera_->next(std::chrono::milliseconds(20));
    cuts = false;
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

TEST_F(GenicamCameraTest, AnExposureThatCannotBeReadIsAsItWas) {
  exposure_us = 4000;
  connect();
  answers = false;
  const int before = asked;
  while (asked == before) EXPECT_NEAR(picture().exposure_s, 0.004, 1e-7);
  EXPECT_NEAR(picture().exposure_s, 0.004, 1e-7);
}

// Aravis asks again and again, for seconds: who waits for pictures would be held up.
TEST_F(GenicamCameraTest, ACameraThatSendsNothingIsNotAskedForItsExposure) {
  connect();
  picture();
  sends = false;
  const int before = asked;
  wait_s(1.3);
  EXPECT_EQ(asked, before);
}

TEST_F(GenicamCameraTest, OnlyWhatCutsManyPicturesIsWhyNoneIsWhole) {
  config_.silent_s = 1;
  connect();
  picture();
  cut_a_picture();
  EXPECT_EQ(camera_->why_silent(), "") << "a cable that was pulled out cuts one";
  cuts = true;
  wait_s(0.5);
  EXPECT_THAT(camera_->why_silent(), ::testing::HasSubstr("sends only incomplete pictures"));
  sends = false;
  wait_s(0.7);
  EXPECT_EQ(camera_->why_silent(), "") << "now nothing comes at all";
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
