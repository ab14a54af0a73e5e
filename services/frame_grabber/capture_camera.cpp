// V4L2, GStreamer and network cameras through OpenCV. Stamps are arrival less latency: these cameras tell no time.
//
// Opening and reading may block for as long as the device likes, so a thread does it that nobody has to wait for.
#include <atomic>
#include <cctype>
#include <condition_variable>
#include <mutex>
#include <opencv2/core/utils/logger.hpp>
#include <opencv2/videoio.hpp>
#include <thread>
#include <utility>

#include "core/time.hpp"
#include "frame_grabber/live_camera.hpp"

namespace railfix::frame_grabber {
namespace {

using core::Error;
using core::Result;

/// What the thread that waits for the device and the camera's user share. The device may block that thread for good:
/// then it is left behind with its half of this.
struct Shared {
  std::mutex mutex;
  std::condition_variable changed;
  bool stop = false;
  bool ended = false;   // the thread is through
  std::string backend;  // once it is open
  std::string problem;  // why it cannot be opened or read any more
  std::optional<RawPicture> newest;
};

constexpr std::chrono::seconds kOpenPatience{15};
constexpr std::chrono::milliseconds kEndPatience{500};

/// One device, pipeline or file, as OpenCV opens it.
class Capture {
 public:
  Capture(std::string what, const LiveConfig& config) : what_(std::move(what)), config_(config) {}

  [[nodiscard]] std::string name() const { return "camera capture:" + what_; }
  /// The thread.
  void run(Shared& shared) {
    std::string problem;
    try {
      if (open()) {
        tell(shared, [this](Shared& s) { s.backend = capture_.getBackendName(); });
        while (problem.empty() && !stopped(shared)) problem = take(shared);
      } else {
        problem = how_it_failed();
      }
    } catch (const cv::Exception& error) {
      problem = shared.backend.empty() ? how_it_failed() : name() + " cannot be read: " + error.err;
    }
    capture_.release();
    tell(shared, [&problem](Shared& s) {
      s.problem = problem;
      s.ended = true;
    });
  }

 private:
  template <class Change>
  static void tell(Shared& shared, Change change) {
    const std::lock_guard lock(shared.mutex);
    change(shared);
    shared.changed.notify_all();
  }
  static bool stopped(Shared& shared) {
    const std::lock_guard lock(shared.mutex);
    return shared.stop;
  }
  [[nodiscard]] bool device() const {
    return what_.starts_with("/dev/") || (what_.size() == 1 && std::isdigit(static_cast<unsigned char>(what_[0])) != 0);
  }
  [[nodiscard]] bool pipeline() const { return what_.find('!') != std::string::npos; }
  bool open() {
    cv::utils::logging::setLogLevel(cv::utils::logging::LOG_LEVEL_SILENT);  // our sentence is enough
    const bool opened = pipeline()                      ? capture_.open(what_, cv::CAP_GSTREAMER)
                        : what_.size() == 1 && device() ? capture_.open(what_[0] - '0', cv::CAP_V4L2)
                                                        : capture_.open(what_, device() ? cv::CAP_V4L2 : cv::CAP_ANY);
    if (!opened) return false;
    if (config_.width_px > 0) capture_.set(cv::CAP_PROP_FRAME_WIDTH, static_cast<double>(config_.width_px));
    if (config_.height_px > 0) capture_.set(cv::CAP_PROP_FRAME_HEIGHT, static_cast<double>(config_.height_px));
    if (config_.rate_hz > 0) capture_.set(cv::CAP_PROP_FPS, config_.rate_hz);
    const double rate_hz = config_.rate_hz > 0 ? config_.rate_hz : capture_.get(cv::CAP_PROP_FPS);
    const bool is_file = !device() && !pipeline() && capture_.get(cv::CAP_PROP_FRAME_COUNT) > 0;
    file_period_ns_ = is_file && rate_hz > 0 ? core::to_ns(1 / rate_hz) : 0;  // a file waits for nobody
    next_due_ns_ = core::monotonic_ns();
    return true;
  }
  /// Waits for the next picture; says why there is none.
  std::string take(Shared& shared) {
    if (file_period_ns_ > 0) {
      std::this_thread::sleep_for(std::chrono::nanoseconds(next_due_ns_ - core::monotonic_ns()));
      next_due_ns_ += file_period_ns_;
    }
    const auto grabbed = capture_.grab();
    const int64_t arrival_ns = core::wall_ns();
    auto frame = std::make_shared<cv::Mat>();
    if (!grabbed || !capture_.retrieve(*frame) || frame->empty()) {
      return name() + " has ended or was unplugged; check cable and power, it is tried again";
    }
    if (frame->depth() != CV_8U || (frame->channels() != 1 && frame->channels() != 3)) {
      return name() + " gives neither grey nor colour pictures of 8 bits; set it to one of them";
    }
    RawPicture picture;
    picture.stamp_ns = arrival_ns - core::to_ns(config_.latency_ms * 1e-3);
    picture.size = frame->size();
    picture.format = frame->channels() == 1 ? PixelFormat::mono8 : PixelFormat::bgr8;
    picture.bytes = frame->data;
    picture.row_bytes = frame->step;
    picture.keep = frame;
    tell(shared, [&picture](Shared& s) {
      if (s.newest) picture.lost = s.newest->lost + 1;
      s.newest = std::move(picture);
    });
    return {};
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

class CaptureCamera final : public LiveCamera {
 public:
  CaptureCamera(std::string what, const LiveConfig& config) : what_(std::move(what)), config_(config) {}
  ~CaptureCamera() override { CaptureCamera::disconnect(); }

  Result<std::string> connect() override {
    if (shared_ && !left_alone()) return Error{name() + " blocks; switch it off and on, it is tried again"};
    {
      const std::lock_guard lock(swap_);
      shared_ = std::make_shared<Shared>();
    }
    thread_ =
        std::thread([capture = std::make_shared<Capture>(what_, config_), shared = shared_] { capture->run(*shared); });
    std::unique_lock lock(shared_->mutex);
    const bool answered = shared_->changed.wait_for(
        lock, kOpenPatience, [this] { return cancelled_ || shared_->ended || !shared_->backend.empty(); });
    if (shared_->ended) return Error{shared_->problem};
    if (!answered || cancelled_) return Error{name() + " does not answer; check cable, power and address"};
    return name() + " is open through " + shared_->backend;
  }

  Result<std::optional<RawPicture>> next(std::chrono::milliseconds patience) override {
    std::unique_lock lock(shared_->mutex);
    shared_->changed.wait_for(lock, patience, [this] { return cancelled_ || shared_->ended || shared_->newest; });
    if (!shared_->newest && shared_->ended) return Error{shared_->problem};
    return std::exchange(shared_->newest, std::nullopt);
  }

  void disconnect() override {
    if (!thread_.joinable()) return;
    std::unique_lock lock(shared_->mutex);
    shared_->stop = true;
    shared_->newest.reset();
    const bool ended = shared_->changed.wait_for(lock, kEndPatience, [this] { return shared_->ended; });
    lock.unlock();
    if (ended) {
      thread_.join();
    } else {
      thread_.detach();
    }
  }

  void cancel() override {
    cancelled_ = true;
    const std::lock_guard swap(swap_);
    if (!shared_) return;
    const std::lock_guard lock(shared_->mutex);
    shared_->changed.notify_all();
  }
  [[nodiscard]] std::string name() const override { return "camera capture:" + what_; }

 private:
  /// No thread of an earlier connection is still stuck in the device.
  [[nodiscard]] bool left_alone() const {
    const std::lock_guard lock(shared_->mutex);
    return shared_->ended;
  }

  std::string what_;
  LiveConfig config_;
  std::mutex swap_;  // cancel() comes from another thread
  std::shared_ptr<Shared> shared_;
  std::thread thread_;
  std::atomic<bool> cancelled_ = false;
};

}  // namespace

std::unique_ptr<LiveCamera> make_capture_camera(const std::string& what, const LiveConfig& config) {
  return std::make_unique<CaptureCamera>(what, config);
}

}  // namespace railfix::frame_grabber
