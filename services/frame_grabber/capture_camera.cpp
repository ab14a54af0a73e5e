// V4L2, GStreamer pipelines and network cameras. Stamps are the time at which a picture, or the first of its data, came
// to this computer, less latency: these cameras tell no time. What decoding takes is no part of it.
//
// Opening and reading may block for as long as the device likes, so a thread does it that nobody has to wait for.
#include <atomic>
#include <cctype>
#include <condition_variable>
#include <mutex>
#include <thread>
#include <utility>

#include "core/time.hpp"
#include "frame_grabber/live_camera.hpp"
#include "video/stream.hpp"

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
  bool open = false;    // it runs
  std::string problem;  // why it cannot be opened or read any more
  std::optional<RawPicture> newest;
};

constexpr std::chrono::seconds kOpenPatience{15};
constexpr std::chrono::milliseconds kEndPatience{500};
constexpr std::chrono::milliseconds kStopCheck{100};

/// One device, pipeline, address or file.
class Capture {
 public:
  Capture(std::string what, const LiveConfig& config) : what_(std::move(what)), config_(config) {}

  [[nodiscard]] std::string name() const { return "camera capture:" + what_; }
  /// The thread.
  void run(Shared& shared) {
    std::string problem;
    {
      auto opened = open();
      if (!opened.ok()) problem = how_it_failed(opened.error().message);
      while (problem.empty() && !stopped(shared)) problem = take(shared, *opened.value());
    }
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
  [[nodiscard]] bool address() const { return what_.find("://") != std::string::npos; }
  [[nodiscard]] bool is_file() const { return !pipeline() && !device() && !address(); }
  [[nodiscard]] Result<std::unique_ptr<video::VideoStream>> open() const {
    if (pipeline()) return video::open_pipeline(what_);
    if (device()) {
      return video::open_device(what_.size() == 1 ? "/dev/video" + what_ : what_,
                                {config_.width_px, config_.height_px, config_.rate_hz});
    }
    return address() ? video::open_url(what_) : video::open_file(what_, video::Pace::real, video::Colours::grey);
  }
  /// Waits for the next picture; says why there is none.
  std::string take(Shared& shared, video::VideoStream& stream) const {
    auto next = stream.next(kStopCheck);
    const int64_t arrival_ns = core::wall_ns();
    if (!next.ok()) return shared.open ? gone(next.error().message) : how_it_failed(next.error().message);
    if (!shared.open && (next.value() || stream.playing())) tell(shared, [](Shared& s) { s.open = true; });
    if (!next.value()) return stream.ended() ? gone("") : "";
    const auto frame = std::make_shared<video::Frame>(*std::move(next).value());
    RawPicture picture;
    picture.stamp_ns = arrival_ns - (is_file() ? 0 : frame->age_ns) - core::to_ns(config_.latency_ms * 1e-3);
    picture.size = frame->pixels.size();
    picture.format = PixelFormat::mono8;
    picture.bytes = frame->pixels.data;
    picture.row_bytes = frame->pixels.step;
    picture.keep = frame;
    tell(shared, [&picture](Shared& s) {
      if (s.newest) picture.lost = s.newest->lost + 1;
      s.newest = std::move(picture);
    });
    return {};
  }
  [[nodiscard]] std::string gone(const std::string& why) const {
    return name() + " has ended or was unplugged; check cable and power, it is tried again" + in_brackets(why);
  }
  [[nodiscard]] std::string how_it_failed(const std::string& why) const {
    if (pipeline()) {
      return name() + " cannot be opened; try it with gst-launch-1.0, and end it with `! videoconvert ! appsink`" +
             in_brackets(why);
    }
    if (device()) {
      return name() +
             " cannot be opened; see with `v4l2-ctl --list-devices` that it is there, that no other program uses it, "
             "and with --list-formats-ext that it has such a size and rate" +
             in_brackets(why);
    }
    return name() + " cannot be opened; check the address or the file" + in_brackets(why);
  }
  static std::string in_brackets(const std::string& why) { return why.empty() ? "" : " (" + why + ")"; }

  std::string what_;
  LiveConfig config_;
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
    const bool answered = shared_->changed.wait_for(lock, kOpenPatience,
                                                    [this] { return cancelled_ || shared_->ended || shared_->open; });
    if (shared_->ended) return Error{shared_->problem};
    if (!answered || cancelled_) {
      return Error{name() +
                   " does not answer; check cable, power and address, and that a camera with trigger gets one"};
    }
    return name() + " is open";
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
