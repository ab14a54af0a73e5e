// frame_grabber as a program with network cameras on the loopback: H.264, H.265 and JPEG over RTSP, JPEG over HTTP.
#include <gst/rtsp-server/rtsp-server.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>
#include <thread>

#include "core/time.hpp"
#include "live_camera.hpp"
#include "pictures/encode.hpp"
#include "support/loopback.hpp"
#include "video/gstreamer.hpp"
#include "video/stream.hpp"

namespace railfix {
namespace {

using ::testing::HasSubstr;

/// An RTSP server with one stream, "rtsp://127.0.0.1:PORT/stream".
class RtspCamera {
 public:
  explicit RtspCamera(const std::string& encoder)
      : context_(g_main_context_new()), loop_(g_main_loop_new(context_, FALSE)), server_(gst_rtsp_server_new()) {
    gst_rtsp_server_set_address(server_, "127.0.0.1");
    gst_rtsp_server_set_service(server_, "0");
    GstRTSPMediaFactory* const factory = gst_rtsp_media_factory_new();
    gst_rtsp_media_factory_set_launch(
        factory, ("( videotestsrc is-live=true pattern=snow ! video/x-raw,format=I420,width=320,height=240,"
                  "framerate=20/1 ! " +
                  encoder + " name=pay0 )")
                     .c_str());
    GstRTSPMountPoints* const places = gst_rtsp_server_get_mount_points(server_);
    gst_rtsp_mount_points_add_factory(places, "/stream", factory);
    g_object_unref(places);
    gst_rtsp_server_attach(server_, context_);
    thread_ = std::thread([this] { g_main_loop_run(loop_); });
  }
  ~RtspCamera() {
    g_main_loop_quit(loop_);
    thread_.join();
    g_object_unref(server_);
    g_main_loop_unref(loop_);
    g_main_context_unref(context_);
  }
  RtspCamera(const RtspCamera&) = delete;
  RtspCamera& operator=(const RtspCamera&) = delete;
  [[nodiscard]] std::string url() const {
    return "rtsp://127.0.0.1:" + std::to_string(gst_rtsp_server_get_bound_port(server_)) + "/stream";
  }

 private:
  GMainContext* context_;
  GMainLoop* loop_;
  GstRTSPServer* server_;
  std::thread thread_;
};

/// A web camera: one picture behind the other in one answer that does not end.
class HttpCamera {
 public:
  HttpCamera() : socket_(test::tcp_socket()), port_(test::bind_to_loopback(socket_)) {
    listen(socket_, 4);
    thread_ = std::thread([this] { serve(); });
  }
  ~HttpCamera() {
    stop_ = true;
    shutdown(socket_, SHUT_RDWR);
    thread_.join();
    close(socket_);
  }
  HttpCamera(const HttpCamera&) = delete;
  HttpCamera& operator=(const HttpCamera&) = delete;
  /// When the picture of this grey was sent; the greys come again after 60.
  [[nodiscard]] int64_t sent_ns(double grey) const { return sent_ns_.at(static_cast<size_t>(std::lround(grey / 4))); }
  [[nodiscard]] std::string url() const { return "http://127.0.0.1:" + std::to_string(port_) + "/video.mjpg"; }

 private:
  void serve() {
    for (int client = accept(socket_, nullptr, nullptr); client >= 0; client = accept(socket_, nullptr, nullptr)) {
      const auto say = [client](const std::string& text) {
        return send(client, text.data(), text.size(), MSG_NOSIGNAL) == static_cast<ssize_t>(text.size());
      };
      bool heard = say("HTTP/1.1 200 OK\r\nContent-Type: multipart/x-mixed-replace;boundary=cut\r\n\r\n");
      for (size_t i = 0; heard && !stop_; ++i) {
        const std::vector<uint8_t> pixels(320 * 240, grey_of(i));
        sent_ns_[i % kGreys] = core::wall_ns();
        const auto jpeg = pictures::encode_jpeg(pixels.data(), 320, 240, 90).value();
        heard = say("--cut\r\nContent-Type: image/jpeg\r\nContent-Length: " + std::to_string(jpeg.size()) + "\r\n\r\n" +
                    std::string(jpeg.begin(), jpeg.end()) + "\r\n");
        std::this_thread::sleep_for(std::chrono::milliseconds(50));  // its rate
      }
      close(client);
    }
  }

  static constexpr size_t kGreys = 60;
  static uint8_t grey_of(size_t picture) { return static_cast<uint8_t>(picture % kGreys * 4); }

  std::array<std::atomic<int64_t>, kGreys> sent_ns_{};
  int socket_;
  int port_;
  std::atomic<bool> stop_ = false;
  std::thread thread_;
};

class NetworkCamera : public LiveCamera {
 protected:
  static void SetUpTestSuite() { ASSERT_TRUE(video::start_gstreamer().ok()); }
  void expect_pictures_from(const std::string& url) {
    const auto service = grabber("capture:" + url, {"frame_grabber.live.silent_s=10"});
    ASSERT_TRUE(run_until([this] { return frames_.size() >= 20; })) << url << ": " << reason();
    expect_growing_stamps();
    EXPECT_EQ(frames_[0].width_px, 320U);
    EXPECT_EQ(frames_[0].height_px, 240U);
    EXPECT_EQ(service->end(SIGTERM), 0);
  }
};

// The decoders of the image, also where FFmpeg is.
TEST_F(NetworkCamera, H264AndH265) {
  setenv("GST_PLUGIN_FEATURE_RANK", "avdec_h264:NONE,avdec_h265:NONE", 1);
  for (const char* encoder : {"openh264enc ! rtph264pay config-interval=1",
                              "x265enc tune=zerolatency speed-preset=ultrafast ! rtph265pay config-interval=1"}) {
    const RtspCamera camera(encoder);
    frames_.clear();
    expect_pictures_from(camera.url());
  }
  unsetenv("GST_PLUGIN_FEATURE_RANK");
}

TEST_F(NetworkCamera, JpegOverRtsp) {
  const RtspCamera camera("jpegenc ! rtpjpegpay");
  expect_pictures_from(camera.url());
}

TEST_F(NetworkCamera, JpegOverHttp) {
  const HttpCamera camera;
  expect_pictures_from(camera.url());
}

// A decoder that gathers pictures before it gives the first would make them look younger by what it has gathered.
TEST_F(NetworkCamera, StampsAreThoseOfTheArrival) {
  const HttpCamera camera;
  auto stream = video::open_url(camera.url());
  ASSERT_TRUE(stream.ok()) << stream.error().message;
  // A busy computer makes some look older or younger, a decoder that gathers all of them.
  std::vector<double> since_s;
  for (int i = 0; i < 20; ++i) {
    const auto frame = stream.value()->next(std::chrono::seconds(20));
    ASSERT_TRUE(frame.ok() && frame.value());
    const int64_t stamp_ns = core::wall_ns() - frame.value()->age_ns;
    since_s.push_back(core::seconds(stamp_ns - camera.sent_ns(cv::mean(frame.value()->pixels)[0])));
  }
  std::ranges::sort(since_s);
  EXPECT_NEAR(since_s[since_s.size() / 2], 0, 0.5);
}

TEST_F(NetworkCamera, ThatGoesAndComesBackIsSaid) {
  auto camera = std::make_unique<HttpCamera>();
  const std::string url = camera->url();
  const auto service = grabber("capture:" + url, {"frame_grabber.live.silent_s=1"});
  ASSERT_TRUE(run_until([this] { return frames_.size() >= 5; })) << reason();
  camera.reset();
  EXPECT_TRUE(run_until([&] {
    return status_.state() == msg::STATE_DEGRADED && reason().find("camera capture:" + url) != std::string::npos;
  })) << reason();
}

}  // namespace
}  // namespace railfix
