#include "frame_grabber/frame_grabber_service.hpp"

#include <spdlog/fmt/fmt.h>

#include <algorithm>
#include <cstring>
#include <opencv2/imgproc.hpp>

#include "core/joined.hpp"
#include "core/time.hpp"
#include "messaging/message_words.hpp"
#include "pictures/encode.hpp"
#include "service/data_time.hpp"

namespace railfix::frame_grabber {
namespace {

static_assert(kDark == msg::PICTURE_DARK && kSaturated == msg::PICTURE_SATURATED && kFrozen == msg::PICTURE_FROZEN &&
              kOutOfOrder == msg::PICTURE_OUT_OF_ORDER && kCovered == msg::PICTURE_COVERED &&
              kBlurred == msg::PICTURE_BLURRED);

constexpr int kBadBeforeDegraded = 10;
constexpr int kPicturesTried = 100;
constexpr double kGuessedHeightM = 2.5;
constexpr const char* kNoHostTime =
    "the camera's clock does not follow PTP (live.ptp), so pictures are stamped when they come; see that the camera "
    "has PTP and that a ptp4l of this host's time (UTC, not TAI) is the master on its network";
constexpr std::chrono::milliseconds kWaitCheck{100};

/// "pictures are covered: look for ..."
std::string complaint(uint32_t health) {
  const std::pair<uint32_t, const char*> advice[] = {
      {kFrozen, "the camera or its driver sends the same picture again; switch the camera off and on"},
      {kCovered, "see what is on the lens or the window; deep snow and fog look the same"},
      {kBlurred, "clean lens and window, look for condensation, and check the focus"},
      {kSaturated, "shorten the exposure or turn on its automatic"},
      {kDark, "lengthen the exposure, or see what covers the lens"},
      {kOutOfOrder, "their time stamps do not grow; check the camera's clock"}};
  for (const auto& [bit, what] : advice) {
    if ((health & bit) != 0)
      return "pictures are " + core::joined(messaging::names_of_picture_health(health)) + ": " + what;
  }
  return "";
}

std::string size_text(const cv::Size& size) {
  return std::to_string(size.width) + "x" + std::to_string(size.height);
}

std::optional<dataset::CameraCalibration> calibration_of(const FrameGrabberConfig& config) {
  if (!config.calibration.empty()) return core::value_or_throw(dataset::read_calibration(config.calibration));
  return core::value_or_throw(dataset::find_calibration(config.source));
}

/// Size of the first picture that can be read.
cv::Size picture_size(const FrameGrabberConfig& config) {
  const auto source = core::value_or_throw(dataset::open_pictures(config.source, {config.fps}));
  std::string why = "it is empty";
  for (int tries = 0; tries < kPicturesTried; ++tries) {
    const auto next = source->next();
    if (!next.ok()) {
      why = next.error().message;
      continue;
    }
    if (!next.value()) break;
    return next.value()->grey.size();
  }
  throw core::BadInput(config.source + " holds no picture that can be read: " + why);
}

void check_size(const cv::Size& size) {
  if (static_cast<size_t>(size.area()) <= msg::CAMERA_MAX_PIXELS) return;
  throw core::BadInput("the pictures have " + size_text(size) + " pixels, more than the " +
                       std::to_string(msg::CAMERA_MAX_PIXELS) +
                       " that camera_frame carries; scale them down to 1920x1200");
}

/// A guess that at least shows pictures in the right proportion; mount_known says that it is one.
dataset::CameraCalibration guessed(const cv::Size& size) {
  dataset::CameraCalibration calibration;
  auto& camera = calibration.intrinsics;
  camera.fu_px = camera.fv_px = size.width;
  camera.cu_px = (size.width - 1) / 2.0;
  camera.cv_px = (size.height - 1) / 2.0;
  camera.width_px = size.width;
  camera.height_px = size.height;
  return calibration;
}

}  // namespace

FrameGrabberService::FrameGrabberService(const Config& config, service::Context& context)
    : config_(config),
      context_(context),
      frames_(context.writer(messaging::topics::camera_frame, config.camera)),
      previews_(context.writer(messaging::topics::camera_preview, config.camera)),
      calibrations_(context.writer(messaging::topics::camera_calibration)),
      clock_(context.writer(messaging::topics::data_clock)),
      picture_health_(config.health),
      lock_step_(config.wait_for),
      gathering_(config.wait_for) {
  context_.health().flows(service::Flow::steady);
  if (config_.source.empty()) {
    throw core::BadInput(
        "frame_grabber.source is empty; give a dataset folder, a folder of pictures, a video, genicam:ID or "
        "capture:DEVICE");
  }
  live_camera_ = core::value_or_throw(make_live_camera(config_.source, config_.live_config()));
  if (live_camera_) {
    prepare_live();
  } else {
    prepare_recorded();
  }
  context_.at_stop([this] {
    player_.reset();
    feed_.reset();
  });
}

void FrameGrabberService::prepare_recorded() {
  source_ = core::value_or_throw(dataset::open_pictures(config_.source, {config_.fps}));
  size_ = picture_size(config_);
  check_size(size_);
  publish_calibration(calibration_of(config_));
  context_.on<msg::DataProgress>(messaging::topics::data_progress,
                                 [this](const msg::DataProgress& progress) { answered(progress); });
  context_.on_command("start", [this](const std::string&) { return start(); });
  context_.every(kWaitCheck, [this] {
    start_when_connected();
    check_wait();
    finish_after_last_words();
  });
  if (config_.start != "immediately") return;
  made_ns_ = core::monotonic_ns();
  if (config_.wait_for.empty()) return;
  context_.on<msg::ServiceStatus>(messaging::topics::service_status, [this](const msg::ServiceStatus& status) {
    const std::string service = status.service().c_str();
    if (service == "frame_grabber" || status.state() == msg::STATE_STARTING) return;
    gathering_.heard(service, {status.endpoints(), status.matches()});
  });
}

void FrameGrabberService::start_when_connected() {
  if (!made_ns_) return;
  const bool complete = config_.wait_for.empty() || gathering_.complete(context_.participant().connections());
  const bool gave_up = core::seconds(core::monotonic_ns() - *made_ns_) > config_.wait_s;
  if (!complete && !gave_up) return;
  made_ns_.reset();
  (void)start();
}

core::Result<std::string> FrameGrabberService::start() {
  if (!source_) return std::string("plays already");
  PlayerEvents events;
  events.picture = [this](dataset::Picture picture) {
    context_.post([this, picture = std::move(picture)] { play(picture); });
  };
  events.late = [this](int64_t) { context_.post([this] { context_.health().dropped(1); }); };
  events.broken = [this](const std::string& why) { context_.post([this, why] { broken(why); }); };
  events.ended = [this] { context_.post([this] { end(); }); };
  context_.log().info("plays {} at {} pace", config_.source, config_.pace);
  context_.health().active();
  player_ = std::make_unique<Player>(std::move(source_), !lossless(), static_cast<size_t>(config_.read_ahead),
                                     std::move(events), began_ns());
  return std::string("plays ") + config_.source;
}

std::optional<int64_t> FrameGrabberService::began_ns() const {
  if (config_.began_s == 0) return std::nullopt;
  return core::to_ns(config_.began_s);
}

void FrameGrabberService::play(const dataset::Picture& picture) {
  const int64_t grabbed_ns = core::wall_ns();
  if (picture.grey.size() != size_) {
    broken("picture " + picture.name + " has " + size_text(picture.grey.size()) + " pixels where the first has " +
           size_text(size_));
    return player_->complete();
  }
  context_.health().input();
  newest_ns_ = std::max(newest_ns_, picture.stamp_ns);
  if (!lossless() && core::monotonic_ns() - clock_sent_ns_ >= service::DataTime::kPeriodNs)
    publish_clock(newest_ns_, grabbed_ns, false);
  publish(raw_of(picture.stamp_ns, picture.grey), grabbed_ns);
  if (!lossless()) return player_->complete();
  sent_.note(messaging::sent_samples(context_.participant()));
  lock_step_.begin();
  give_turn();
}

void FrameGrabberService::give_turn() {
  if (lock_step_.done()) {
    waiting_since_ns_.reset();
    return player_->complete();
  }
  waiting_since_ns_ = core::monotonic_ns();
  publish_clock(newest_ns_, core::wall_ns(), false);
}

void FrameGrabberService::answered(const msg::DataProgress& progress) {
  if (!lock_step_.answered(progress.service().c_str(), progress.seq())) return;
  sent_.note(progress.sent());
  give_turn();
}

void FrameGrabberService::publish(const RawPicture& picture, int64_t grabbed_ns) {
  ++frame_seq_;
  uint32_t health = 0;
  const bool sent = frames_.write_in_place([&](msg::CameraFrame& frame) {
    uint8_t* pixels = frame.data().data();
    to_mono8(picture, pixels);
    health = picture_health_.judge(picture.stamp_ns, cv::Mat(picture.size, CV_8UC1, pixels));
    frame.stamp_ns(picture.stamp_ns);
    frame.grabbed_ns(grabbed_ns);
    frame.seq(frame_seq_);
    frame.width_px(static_cast<uint32_t>(picture.size.width));
    frame.height_px(static_cast<uint32_t>(picture.size.height));
    frame.exposure_s(picture.exposure_s);
    frame.health(health);
  });
  if (sent) {
    unsent_in_a_row_ = 0;
    context_.health().output(grabbed_ns);
  } else {
    ++unsent_in_a_row_;
    context_.health().dropped(1);
  }
  say_health(health);
  publish_preview(picture, grabbed_ns, health);
}

void FrameGrabberService::publish_preview(const RawPicture& picture, int64_t grabbed_ns, uint32_t health) {
  if (config_.preview_hz <= 0) return;
  const int64_t period_ns = core::to_ns(1.0 / config_.preview_hz);
  if (preview_ns_ && picture.stamp_ns >= *preview_ns_ && picture.stamp_ns - *preview_ns_ < period_ns) return;
  preview_ns_ = picture.stamp_ns;
  preview_grey_.create(picture.size, CV_8UC1);
  to_mono8(picture, preview_grey_.data);
  cv::Mat small = preview_grey_;
  if (small.cols > config_.preview_width_px) {
    const double scale = static_cast<double>(config_.preview_width_px) / small.cols;
    small = cv::Mat();
    cv::resize(preview_grey_, small, {}, scale, scale, cv::INTER_AREA);
  }
  auto jpeg = pictures::encode_jpeg(small.data, static_cast<uint32_t>(small.cols), static_cast<uint32_t>(small.rows),
                                    static_cast<int>(config_.preview_quality));
  if (!jpeg.ok()) return context_.log().warn("no preview: {}", jpeg.error().message);
  msg::CameraPreview preview;
  preview.stamp_ns(picture.stamp_ns);
  preview.grabbed_ns(grabbed_ns);
  preview.seq(frame_seq_);
  preview.width_px(static_cast<uint32_t>(small.cols));
  preview.height_px(static_cast<uint32_t>(small.rows));
  preview.exposure_s(picture.exposure_s);
  preview.health(health);
  preview.jpeg(std::move(jpeg).value());
  previews_.write(preview);
}

void FrameGrabberService::publish_calibration(const std::optional<dataset::CameraCalibration>& found) {
  dataset::CameraCalibration calibration = found ? *found : guessed(size_);
  if (!found) context_.log().warn("no calibration lies with {}; the focal length is a guess", config_.source);
  if (!calibration.mount) context_.log().warn("the camera's mount is not known; run `railfix calibrate mount`");
  auto& camera = calibration.intrinsics;
  if (camera.width_px == 0) {  // KITTI's calibration does not say
    camera.width_px = size_.width;
    camera.height_px = size_.height;
  }
  if (cv::Size(camera.width_px, camera.height_px) != size_) {
    throw core::BadInput("the pictures have " + size_text(size_) + " pixels, but the calibration is for " +
                         size_text({camera.width_px, camera.height_px}) + "; give the camera's own calibration");
  }
  geometry::CameraPose guess;
  guess.height_m = kGuessedHeightM;
  const geometry::CameraPose mount = calibration.mount.value_or(guess);
  if (calibration.mount) picture_health_.watch_track(camera, mount);
  msg::CameraCalibration message;
  message.camera(config_.camera);
  message.fu_px(camera.fu_px);
  message.fv_px(camera.fv_px);
  message.cu_px(camera.cu_px);
  message.cv_px(camera.cv_px);
  message.k1(camera.k1);
  message.k2(camera.k2);
  message.p1(camera.p1);
  message.p2(camera.p2);
  message.height_m(mount.height_m);
  message.pitch_rad(mount.pitch_rad);
  message.yaw_rad(mount.yaw_rad);
  message.roll_rad(mount.roll_rad);
  message.lateral_m(mount.lateral_m);
  message.width_px(static_cast<uint32_t>(camera.width_px));
  message.height_px(static_cast<uint32_t>(camera.height_px));
  message.mount_known(calibration.mount.has_value());
  calibrations_.write(message);
}

void FrameGrabberService::publish_clock(int64_t data_ns, int64_t wall_ns, bool ended) {
  clock_sent_ns_ = core::monotonic_ns();
  msg::DataClock clock;
  clock.data_ns(data_ns);
  clock.wall_ns(wall_ns);
  clock.seq(lossless() ? lock_step_.step() : ++clock_seq_);
  clock.lock_step(lossless() ? 1 : 0);
  clock.ended(ended ? 1 : 0);
  if (lossless() && !ended) {
    clock.turn(lock_step_.turn());
    sent_.say(clock);
  }
  clock_.write(clock);
}

void FrameGrabberService::say_health(uint32_t health) {
  if (unsent_in_a_row_ >= kBadBeforeDegraded)
    return context_.health().degraded("pictures cannot be sent: the middleware takes none; see that /dev/shm has room");
  bad_in_a_row_ = health == 0 ? 0 : bad_in_a_row_ + 1;
  if (bad_in_a_row_ >= kBadBeforeDegraded) return context_.health().degraded(complaint(health));
  if (no_host_time_) return context_.health().degraded(kNoHostTime);
  if (bad_in_a_row_ == 0) context_.health().active();
}

void FrameGrabberService::broken(const std::string& why) {
  context_.log().warn("{}", why);
  context_.health().dropped(1);
}

void FrameGrabberService::end() {
  publish_clock(newest_ns_, core::wall_ns(), true);
  context_.log().info("played {} pictures", frame_seq_);
  ended_ns_ = core::monotonic_ns();
}

void FrameGrabberService::finish_after_last_words() {
  if (!ended_ns_ || config_.at_end != "finish" || core::monotonic_ns() - *ended_ns_ < service::kLastWordsNs) return;
  context_.finish("all pictures played");
}

void FrameGrabberService::check_wait() {
  if (gave_up_ns_ && core::monotonic_ns() - *gave_up_ns_ > service::kLastWordsNs)
    throw std::runtime_error(gave_up_why_);
  if (gave_up_ns_ || !waiting_since_ns_) return;
  if (core::seconds(core::monotonic_ns() - *waiting_since_ns_) < config_.wait_s) return;
  gave_up_why_ = fmt::format(
      "no answer on data_progress from {} for {} s at picture {}; see that these services run with common.lock_step",
      lock_step_.turn(), config_.wait_s, frame_seq_);
  gave_up_ns_ = core::monotonic_ns();
  context_.health().failed(gave_up_why_);
}

}  // namespace railfix::frame_grabber
