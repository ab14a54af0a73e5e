// frame_grabber as a program with live cameras: Aravis's fake GigE Vision camera on the loopback, GStreamer pipelines
// and a file.
#include <gmock/gmock.h>
#include <sys/file.h>
#include <sys/stat.h>

#include <opencv2/videoio.hpp>
#include <span>

#include "core/time.hpp"
#include "live_camera.hpp"

namespace railfix {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
const char* const kFakeCamera = "/usr/bin/arv-fake-gv-camera-0.8";

/// The fake camera has one fixed port: tests of several builds on one computer take turns.
class OnlyOne {
 public:
  OnlyOne() : file_(open("/tmp/railfix-fake-camera.lock", O_RDWR | O_CREAT | O_CLOEXEC, 0666)) {
    flock(file_, LOCK_EX);
  }
  ~OnlyOne() { close(file_); }
  OnlyOne(const OnlyOne&) = delete;
  OnlyOne& operator=(const OnlyOne&) = delete;

 private:
  int file_;
};

// The fake camera's picture is a smooth ramp, which is what a cover looks like: that has to last longer than the test.
TEST_F(LiveCamera, AGigeCameraThatComesGoesAndComesBack) {
  if (!std::filesystem::exists(kFakeCamera)) GTEST_SKIP() << "aravis-tools are not installed";
  const OnlyOne only_one;
  const auto service = grabber(
      "genicam:127.0.0.1",
      {"frame_grabber.fps=20", "frame_grabber.live.exposure_us=4000", "frame_grabber.live.width_px=320",
       "frame_grabber.live.height_px=240", "frame_grabber.live.silent_s=1", "frame_grabber.live.reconnect_s=0.2",
       "frame_grabber.health.persist_s=600", "frame_grabber.health.frozen_after_pictures=10000"});
  ASSERT_TRUE(run_until([&] { return status_.state() == msg::STATE_DEGRADED; }));
  EXPECT_THAT(reason(), AllOf(HasSubstr("genicam:127.0.0.1 is not found"), HasSubstr("check cable, power")));

  auto camera = std::make_unique<test::Program>(std::vector<std::string>{kFakeCamera, "-i", "127.0.0.1"});
  ASSERT_TRUE(run_until([&] { return frames_.size() >= 30 && status_.state() == msg::STATE_ACTIVE; })) << reason();
  expect_growing_stamps();
  EXPECT_EQ(frames_[0].width_px, 320U);
  EXPECT_EQ(frames_[0].height_px, 240U);
  EXPECT_NEAR(frames_[0].exposure_s, 0.004, 1e-6);
  EXPECT_FALSE(calibration_->mount_known());
  const auto& last = frames_.back();
  double period_s = 0;
  for (const auto& first : std::span(frames_).first(10)) {  // some of them may be late where this computer is busy
    const auto pictures = static_cast<double>(last.seq - first.seq);
    period_s = std::max(period_s, core::seconds(last.stamp_ns - first.stamp_ns) / pictures);
  }
  EXPECT_GT(period_s, 0.045) << "a slow computer may lose pictures, but cannot make more";
  EXPECT_LT(std::abs(core::seconds(last.grabbed_ns - last.stamp_ns)), 5.0);

  camera.reset();
  ASSERT_TRUE(run_until([&] {
    return reason().find("sends no picture for 1.0 s") != std::string::npos ||
           reason().find("is not found") != std::string::npos;
  })) << reason();
  EXPECT_EQ(status_.state(), msg::STATE_DEGRADED);
  const size_t before = frames_.size();
  camera = std::make_unique<test::Program>(std::vector<std::string>{kFakeCamera, "-i", "127.0.0.1"});
  ASSERT_TRUE(run_until([&] { return frames_.size() >= before + 10 && status_.state() == msg::STATE_ACTIVE; }))
      << reason();
  expect_growing_stamps();
}

// As with a wrong MTU: of every picture packets are missing.
TEST_F(LiveCamera, PicturesThatComeIncompleteAreCountedAndNamed) {
  if (!std::filesystem::exists(kFakeCamera)) GTEST_SKIP() << "aravis-tools are not installed";
  const OnlyOne only_one;
  const test::Program camera({kFakeCamera, "-i", "127.0.0.1", "-r", "300"});
  const auto service = grabber("genicam:127.0.0.1", {"frame_grabber.fps=20", "frame_grabber.live.silent_s=1",
                                                     "frame_grabber.live.reconnect_s=0.2"});
  ASSERT_TRUE(run_until([&] {
    return reason().find("sends only incomplete pictures (") != std::string::npos && status_.dropped() > 5;
  })) << reason()
      << status_.dropped();
  EXPECT_THAT(reason(), HasSubstr("check live.packet_size against the network card's MTU"));
}

TEST_F(LiveCamera, AGstreamerPipeline) {
  const auto service = grabber(
      "capture:videotestsrc is-live=true pattern=snow ! video/x-raw,format=GRAY8,width=320,height=240,framerate=25/1 ! "
      "appsink",
      {});
  ASSERT_TRUE(run_until([&] { return frames_.size() >= 20 || status_.state() == msg::STATE_DEGRADED; }));
  if (frames_.empty() && reason().find("cannot be opened") != std::string::npos) {
    GTEST_SKIP() << "GStreamer's base plugins are not installed";
  }
  expect_growing_stamps();
  EXPECT_EQ(frames_[0].width_px, 320U);
  EXPECT_EQ(frames_[0].height_px, 240U);
  EXPECT_EQ(frames_.back().health & ~msg::PICTURE_COVERED, 0U);
}

// Opening a pipe that nobody writes to blocks for ever; so does a camera that hangs.
TEST_F(LiveCamera, ADeviceThatBlocksDoesNotHoldUpTheEnd) {
  const std::string pipe = (root_ / "silent").string();
  ASSERT_EQ(mkfifo(pipe.c_str(), 0600), 0);
  const auto service = grabber("capture:" + pipe, {});
  ASSERT_TRUE(run_until([&] { return status_.state() == msg::STATE_READY; }));
  EXPECT_EQ(service->end(SIGTERM), 0);
}

// One picture an hour: reading blocks behind the first.
TEST_F(LiveCamera, APipelineThatStopsIsToldAndDoesNotHoldUpTheEnd) {
  const auto service = grabber(
      "capture:videotestsrc is-live=true ! video/x-raw,format=GRAY8,width=320,height=240,framerate=1/3600 ! appsink",
      {"frame_grabber.live.silent_s=0.5"});
  ASSERT_TRUE(run_until([&] { return status_.state() == msg::STATE_DEGRADED; }));
  if (reason().find("cannot be opened") != std::string::npos)
    GTEST_SKIP() << "GStreamer's base plugins are not installed";
  EXPECT_THAT(reason(), HasSubstr("sends no picture for 0.5 s"));
  EXPECT_EQ(service->end(SIGTERM), 0);
}

TEST_F(LiveCamera, AFileIsPlayedAtItsRateAndBegunAnewAtItsEnd) {
  const std::string file = (root_ / "colour.avi").string();
  cv::VideoWriter video(file, cv::VideoWriter::fourcc('M', 'J', 'P', 'G'), 20, {160, 120});
  ASSERT_TRUE(video.isOpened());
  cv::Mat picture(120, 160, CV_8UC3);
  cv::RNG random(1);
  for (int i = 0; i < 10; ++i) {
    random.fill(picture, cv::RNG::UNIFORM, 0, 255);
    video.write(picture);
  }
  video.release();
  const auto service = grabber("capture:" + file, {"frame_grabber.live.reconnect_s=0.1"});
  ASSERT_TRUE(run_until([&] { return frames_.size() >= 15; })) << reason();
  expect_growing_stamps();
  EXPECT_EQ(frames_[0].width_px, 160U);
}

TEST_F(LiveCamera, ACalibrationOfAnotherSizeIsSaid) {
  write("camera.yaml", "resolution: [80, 60]\nintrinsics: [90, 90, 40, 30]\n");
  const auto service =
      grabber("capture:videotestsrc is-live=true ! video/x-raw,format=GRAY8,width=320,height=240 ! appsink",
              {"frame_grabber.calibration=" + (root_ / "camera.yaml").string()});
  ASSERT_TRUE(run_until([&] { return status_.state() == msg::STATE_DEGRADED; }));
  if (reason().find("cannot be opened") != std::string::npos)
    GTEST_SKIP() << "GStreamer's base plugins are not installed";
  EXPECT_THAT(reason(), HasSubstr("sends 320x240 pixels, but its calibration is for 80x60"));
  EXPECT_TRUE(frames_.empty());
}

TEST_F(LiveCamera, APixelFormatThatIsNotReadIsExitCodeTwo) {
  const auto service = grabber("genicam:any", {"frame_grabber.live.pixel_format=YUV9"});
  EXPECT_EQ(service->wait_for_end(), 2);
}

}  // namespace
}  // namespace railfix
