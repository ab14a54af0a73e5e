// V4L2, GStreamer and network cameras through OpenCV. Stamps are arrival less latency: these cameras tell no time.
#include <cctype>
#include <opencv2/core/utils/logger.hpp>
#include <opencv2/videoio.hpp>
#include <thread>

#include "core/time.hpp"
#include "frame_grabber/live_camera.hpp"

namespace railfix::frame_grabber {
namespace {

using core::Error;
using core::Result;

class CaptureCamera final : public LiveCamera {
 public:
  CaptureCamera(std::string what, const LiveConfig& config) : what_(std::move(what)), config_(config) {}

  Result<std::string> connect() override {
    cv::utils::logging::setLogLevel(cv::utils::logging::LOG_LEVEL_SILENT);  // our sentence is enough
    try {
      if (!open()) return Error{how_it_failed()};
    } catch (const cv::Exception&) {
      return Error{how_it_failed()};
    }
    if (config_.width_px > 0) capture_.set(cv::CAP_PROP_FRAME_WIDTH, static_cast<double>(config_.width_px));
    if (config_.height_px > 0) capture_.set(cv::CAP_PROP_FRAME_HEIGHT, static_cast<double>(config_.height_px));
    if (config_.rate_hz > 0) capture_.set(cv::CAP_PROP_FPS, config_.rate_hz);
    const double rate_hz = config_.rate_hz > 0 ? config_.rate_hz : capture_.get(cv::CAP_PROP_FPS);
    const bool is_file = !device() && !pipeline() && capture_.get(cv::CAP_PROP_FRAME_COUNT) > 0;
    file_period_ns_ = is_file && rate_hz > 0 ? core::to_ns(1 / rate_hz) : 0;  // a file waits for nobody
    next_due_ns_ = core::monotonic_ns();
    return name() + " is open through " + capture_.getBackendName();
  }

  Result<std::optional<RawPicture>> next(std::chrono::milliseconds) override {
    if (file_period_ns_ > 0) {
      std::this_thread::sleep_for(std::chrono::nanoseconds(next_due_ns_ - core::monotonic_ns()));
      next_due_ns_ += file_period_ns_;
    }
    try {
      const auto grabbed = capture_.grab();
      const int64_t arrival_ns = core::wall_ns();
      auto frame = std::make_shared<cv::Mat>();
      if (!grabbed || !capture_.retrieve(*frame) || frame->empty()) {
        return Error{name() + " has ended or was unplugged; check cable and power, it is tried again"};
      }
      if (frame->depth() != CV_8U || (frame->channels() != 1 && frame->channels() != 3)) {
        return Error{name() + " gives neither grey nor colour pictures of 8 bits; set it to one of them"};
      }
      RawPicture picture;
      picture.stamp_ns = arrival_ns - core::to_ns(config_.latency_ms * 1e-3);
      picture.size = frame->size();
      picture.format = frame->channels() == 1 ? PixelFormat::mono8 : PixelFormat::bgr8;
      picture.bytes = frame->data;
      picture.row_bytes = frame->step;
      picture.keep = frame;
      return std::optional<RawPicture>(std::move(picture));
    } catch (const cv::Exception& problem) {
      return Error{name() + " cannot be read: " + problem.err};
    }
  }
  void disconnect() override { capture_.release(); }
  [[nodiscard]] std::string name() const override { return "camera capture:" + what_; }

 private:
  [[nodiscard]] bool device() const {
    return what_.starts_with("/dev/") || (what_.size() == 1 && std::isdigit(static_cast<unsigned char>(what_[0])) != 0);
  }
  [[nodiscard]] bool pipeline() const { return what_.find('!') != std::string::npos; }
  bool open() {
    if (pipeline()) return capture_.open(what_, cv::CAP_GSTREAMER);
    if (what_.size() == 1 && device()) return capture_.open(what_[0] - '0', cv::CAP_V4L2);
    return capture_.open(what_, device() ? cv::CAP_V4L2 : cv::CAP_ANY);
  }
  [[nodiscard]] std::string how_it_failed() const {
    if (pipeline()) {
      return name() + " cannot be opened; try it with gst-launch-1.0, and end it with `! videoconvert ! appsink`";
    }
    if (device()) {
      return name() +
             " cannot be opened; see with `v4l2-ctl --list-devices` that it is there, and that no other program "
             "uses it";
    }
    return name() + " cannot be opened; check the address or the file";
  }

  std::string what_;
  LiveConfig config_;
  cv::VideoCapture capture_;
  int64_t file_period_ns_ = 0;  // 0: not a file
  int64_t next_due_ns_ = 0;
};

}  // namespace

std::unique_ptr<LiveCamera> make_capture_camera(const std::string& what, const LiveConfig& config) {
  return std::make_unique<CaptureCamera>(what, config);
}

}  // namespace railfix::frame_grabber
