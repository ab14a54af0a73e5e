#include "video/stream.hpp"

#include <gmock/gmock.h>
#include <gst/gst.h>

#include <opencv2/imgproc.hpp>

#include "support/film_file.hpp"
#include "unit/dataset/temporary_folder.hpp"
#include "video/gstreamer.hpp"

namespace railfix::video {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;
using ::testing::HasSubstr;

class StreamTest : public railfix::testing::TemporaryFolder {
 protected:
  static void SetUpTestSuite() {
    setenv("GST_PLUGIN_FEATURE_RANK", "avdec_h264:NONE", 1);  // the image has no FFmpeg
    ASSERT_TRUE(start_gstreamer().ok());
  }
  /// Runs a pipeline to its end.
  static void make(const std::string& description) {
    auto pipeline = parse_pipeline(description);
    ASSERT_TRUE(pipeline.ok()) << pipeline.error().message;
    railfix::testing::run_to_end(pipeline.value().get());
  }
  static std::string film(const std::string& encoder, const std::string& file) {
    return "videotestsrc num-buffers=20 pattern=ball ! video/x-raw,format=I420,width=320,height=240,framerate=20/1 ! " +
           encoder + " ! filesink location=" + file;
  }
  static cv::Mat one_of(const std::string& format, const std::string& colour) {
    auto opened =
        open_pipeline("videotestsrc num-buffers=1 pattern=solid-color foreground-color=" + colour +
                      " ! video/x-raw,width=50,height=30,format=BGR ! videoconvert ! video/x-raw,format=" + format +
                      " ! videoconvert ! appsink");
    if (!opened.ok()) return {};
    const auto frame = opened.value()->next(seconds(60));
    return frame.ok() && frame.value() ? frame.value()->pixels.clone() : cv::Mat();
  }
  /// How many pictures come, and what then happens.
  static std::pair<int, std::string> play(core::Result<std::unique_ptr<VideoStream>> opened) {
    if (!opened.ok()) return {0, opened.error().message};
    for (int pictures = 0;; ++pictures) {
      const auto next = opened.value()->next(seconds(60));
      if (!next.ok()) return {pictures, next.error().message};
      if (!next.value()) return {pictures, opened.value()->ended() ? "ended" : "nothing came"};
      EXPECT_EQ(next.value()->pixels.size(), cv::Size(320, 240));
      EXPECT_NEAR(opened.value()->rate_hz(), 20, 1e-6);
    }
  }
};

TEST_F(StreamTest, EveryPictureOfAFilm) {
  const std::string file = root_ / "film";
  for (const char* encoder :
       {"jpegenc ! avimux", "openh264enc ! h264parse ! mp4mux", "openh264enc ! h264parse ! matroskamux"}) {
    make(film(encoder, file));
    EXPECT_EQ(play(open_file(file, Pace::as_asked, Colours::grey)), std::pair(20, std::string("ended"))) << encoder;
  }
}

TEST_F(StreamTest, EveryPictureComesWithItsTime) {
  constexpr int64_t kMs = 1'000'000;
  const std::vector<int64_t> times_ns = {0, 40 * kMs, 80 * kMs, 200 * kMs, 210 * kMs, 500 * kMs};
  const std::string file = root_ / "film";
  railfix::testing::write_film(file, "openh264enc ! h264parse ! mp4mux", "25/1", times_ns);
  auto opened = open_file(file, Pace::as_asked, Colours::grey);
  ASSERT_TRUE(opened.ok()) << opened.error().message;
  std::vector<int64_t> seen_ns;
  for (auto next = opened.value()->next(seconds(60)); next.ok() && next.value();
       next = opened.value()->next(seconds(60))) {
    seen_ns.push_back(next.value()->at_ns.value_or(-1));
  }
  EXPECT_EQ(seen_ns, times_ns);
}

TEST_F(StreamTest, SoundIsLeftOut) {
  const std::string file = root_ / "film";
  make(film("jpegenc ! avimux name=mux", file) + " audiotestsrc num-buffers=20 ! audio/x-raw,rate=8000 ! mux.");
  EXPECT_EQ(play(open_file(file, Pace::as_asked, Colours::grey)), std::pair(20, std::string("ended")));
}

// 16 to 235 and 0 to 255 are both in use, and GStreamer's own way to grey copies either.
TEST_F(StreamTest, GreyIsTheLumaInItsFullRange) {
  for (const std::string format : {"GRAY8", "I420", "NV12", "YUY2", "UYVY", "Y444", "BGR", "RGBx",
                                   "I420,colorimetry=bt709", "I420,colorimetry=1:4:0:0"}) {
    for (const auto& [colour, grey] : {std::pair{"0xff000000", 0.0}, {"0xff808080", 128.0}, {"0xffffffff", 255.0}}) {
      const auto picture = one_of(format, colour);
      ASSERT_EQ(picture.type(), CV_8UC1) << format;
      EXPECT_NEAR(cv::mean(picture)[0], grey, 1.01) << format << " " << colour;
    }
  }
}

TEST_F(StreamTest, ColoursOfAFilm) {
  const std::string file = root_ / "film";
  make(
      "videotestsrc num-buffers=3 pattern=solid-color foreground-color=0xff4080c0 ! "
      "video/x-raw,format=BGR,width=320,height=240,framerate=20/1 ! videoconvert ! "
      "video/x-raw,format=I420,colorimetry=1:4:0:0 ! jpegenc ! avimux ! filesink location=" +
      file);
  auto opened = open_file(file, Pace::as_asked, Colours::bgr);
  ASSERT_TRUE(opened.ok()) << opened.error().message;
  const auto frame = opened.value()->next(seconds(60));
  ASSERT_TRUE(frame.ok() && frame.value());
  ASSERT_EQ(frame.value()->pixels.type(), CV_8UC3);
  const cv::Scalar mean = cv::mean(frame.value()->pixels);
  EXPECT_NEAR(mean[0], 0xc0, 4);
  EXPECT_NEAR(mean[1], 0x80, 4);
  EXPECT_NEAR(mean[2], 0x40, 4);
}

TEST_F(StreamTest, AgeIsWhatThePictureHasWaitedSinceItsSourceHadIt) {
  auto opened = open_pipeline(
      "videotestsrc is-live=true ! video/x-raw,format=GRAY8,width=64,height=48,framerate=10/1 ! "
      "identity sleep-time=50000 ! appsink sync=false max-buffers=1 drop=true");
  ASSERT_TRUE(opened.ok()) << opened.error().message;
  int64_t least_ns = INT64_MAX;
  for (int i = 0; i < 10; ++i) {
    const auto frame = opened.value()->next(seconds(60));
    ASSERT_TRUE(frame.ok() && frame.value());
    least_ns = std::min(least_ns, frame.value()->age_ns);
  }
  EXPECT_GE(least_ns, 50'000'000);
  EXPECT_LT(least_ns, 1'000'000'000) << "on a busy computer too, one of ten is quick";
}

TEST_F(StreamTest, NothingInTimeIsNoEnd) {
  auto opened = open_pipeline("appsrc ! video/x-raw,format=GRAY8,width=8,height=8,framerate=1/1 ! appsink");
  ASSERT_TRUE(opened.ok()) << opened.error().message;
  const auto next = opened.value()->next(milliseconds(50));
  ASSERT_TRUE(next.ok()) << next.error().message;
  EXPECT_FALSE(next.value());
  EXPECT_FALSE(opened.value()->ended());
}

TEST_F(StreamTest, WhatDoesNotWorkIsSaid) {
  EXPECT_THAT(play(open_pipeline("nosuchsrc ! appsink")).second, HasSubstr("no element \"nosuchsrc\""));
  EXPECT_THAT(play(open_pipeline("fakesrc ! fakesink")).second, HasSubstr("no appsink"));
  EXPECT_THAT(play(open_device("/dev/video987", {})).second, HasSubstr("/dev/video987"));
  EXPECT_THAT(play(open_device("/dev/null", {640, 480, 25})).second, HasSubstr("/dev/null"));
  EXPECT_THAT(play(open_file(root_ / "missing.avi", Pace::as_asked, Colours::grey)).second, HasSubstr("missing.avi"));
  EXPECT_NE(play(open_file(write("noise.avi", "no film"), Pace::as_asked, Colours::grey)).second, "ended");
  EXPECT_THAT(play(open_url("rtsp://127.0.0.1:9/nobody")).second, HasSubstr("onnect"));
  const std::string sound = root_ / "sound.wav";
  make("audiotestsrc num-buffers=5 ! wavenc ! filesink location=" + sound);
  EXPECT_NE(play(open_file(sound, Pace::as_asked, Colours::grey)).second, "ended");
}

}  // namespace
}  // namespace railfix::video
