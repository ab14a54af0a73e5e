#include "odometry/odometry_service.hpp"

#include <cmath>
#include <cstring>

#include "core/time.hpp"
#include "core/units.hpp"
#include "messaging/camera.hpp"
#include "messaging/samples.hpp"

namespace railfix::odometry {
namespace {

constexpr std::chrono::milliseconds kExpirePeriod{2};
constexpr int64_t kLockStepWaitNs = 10 * core::kNsPerSecond;
constexpr int64_t kPoseLifeNs = core::kNsPerSecond / 2;
constexpr int64_t kBlindNs = core::kNsPerSecond;
// Places in TrackView.covariance: upper triangle of 7x7, row by row.
constexpr size_t kPoseCovariance[3][3] = {
    {7, 10, 12}, {10, 22, 24}, {12, 24, 27}};  // pitch, height, vertical curvature
// A curvature known worse than this says less than the last one that was known better.
constexpr double kWorstCurvatureSigma = 1e-3;

uint8_t mode_of(MouseMode mode) {
  switch (mode) {
    case MouseMode::search:
      return msg::ODOMETRY_SEARCH;
    case MouseMode::track:
      return msg::ODOMETRY_TRACK;
    case MouseMode::keyframe:
      return msg::ODOMETRY_KEYFRAME;
    case MouseMode::blind:
      break;
  }
  return msg::ODOMETRY_BLIND;
}

const char* sentence_of(MouseWhy why) {
  switch (why) {
    case MouseWhy::no_texture:
      return "blind: the ground shows no texture (dark, glare, snow or a covered lens)";
    case MouseWhy::other_size:
      return "blind: the pictures have another size than the calibration says";
    case MouseWhy::not_newer:
      return "blind: the pictures' time stamps do not grow";
    case MouseWhy::shown_again:
      return "blind: the same picture is shown again though the train moves";
    case MouseWhy::two_motions:
      return "part of the picture moves and part does not (a pattern on the pane, or moving shadows): the train's "
             "motion cannot be told";
    case MouseWhy::repeats_itself:
      return "the ground repeats itself: several motions are as likely";
    case MouseWhy::none:
    case MouseWhy::no_pose:
    case MouseWhy::stamps_jump:
    case MouseWhy::not_found:
    case MouseWhy::beginning:
    case MouseWhy::mount_guessed:
      break;
  }
  return "the ground of one picture is not found in the next (wrong mount, or too fast)";
}

}  // namespace

OdometryService::OdometryService(const Config& config, service::Context& context)
    : config_(config),
      context_(context),
      writer_(context.writer(messaging::topics::odometry_step)),
      views_([this](const Waiting& waiting, const msg::TrackView* view) { measure(waiting, view); }) {
  context_.health().flows(service::Flow::answers);
  context_.on<msg::CameraCalibration>(messaging::topics::camera_calibration,
                                      [this](const msg::CameraCalibration& c) { calibrated(c); });
  context_.on<msg::TrackView>(messaging::topics::track_view, [this](const msg::TrackView& view) { views_.hear(view); });
  context_.on<msg::CameraFrame>(
      messaging::topics::camera_frame, [this](const msg::CameraFrame& frame) { pictured(frame); }, config_.camera);
  context_.every(kExpirePeriod, [this] { views_.expire(core::monotonic_ns()); });
  context_.at_restart([this](int64_t) { restart(); });
  context_.share_charge();
  context_.health().ready();
}

void OdometryService::restart() {
  views_.clear();
  last_pose_ns_ = 0;
  curvature_per_m_ = 0;
  vertical_curvature_per_m_ = 0;
  last_step_ = {};
  last_seq_ = 0;
  last_valid_ns_ = 0;
  last_measured_seq_ = 0;
  last_off_m_ = 0;
  out_of_order_ns_ = 0;
  if (mouse_) mouse_ = std::make_unique<TrainMouse>(intrinsics_, config_.mouse);
}

void OdometryService::calibrated(const msg::CameraCalibration& c) {
  if (config_.camera != c.camera().c_str()) return;
  // A frame_grabber that has begun anew says it once more, and the distance goes on.
  auto said = messaging::serialize(c);
  if (said == calibration_) return;
  calibration_ = std::move(said);
  intrinsics_ = messaging::intrinsics_of(c);
  mount_ = messaging::mount_of(c);
  mount_known_ = c.mount_known();
  last_pose_ns_ = 0;
  mouse_ = std::make_unique<TrainMouse>(intrinsics_, config_.mouse);
  context_.log().info("camera {} {}x{}, {:.2f} m above the rails, pitch {:.2f} deg", config_.camera,
                      intrinsics_.width_px, intrinsics_.height_px, mount_.height_m,
                      core::deg_from_rad(mount_.pitch_rad));
}

cv::Mat OdometryService::spare() {
  if (spare_.empty()) return {};
  cv::Mat buffer = spare_.back();
  spare_.pop_back();
  return buffer;
}

void OdometryService::pictured(const msg::CameraFrame& frame) {
  context_.health().input();
  if (last_seq_ != 0 && frame.seq() > last_seq_ + 1) context_.health().dropped(frame.seq() - last_seq_ - 1);
  last_seq_ = frame.seq();
  const auto width = static_cast<int>(frame.width_px());
  const auto height = static_cast<int>(frame.height_px());
  if (width < 16 || height < 16 || frame.width_px() * uint64_t{frame.height_px()} > msg::CAMERA_MAX_PIXELS) return;
  Waiting waiting;
  waiting.stamp_ns = frame.stamp_ns();
  waiting.grabbed_ns = frame.grabbed_ns();
  waiting.frame_seq = frame.seq();
  waiting.health = frame.health();
  waiting.exposure_s = frame.exposure_s();
  waiting.until_ns =
      core::monotonic_ns() + (context_.common().lock_step ? kLockStepWaitNs : core::to_ns(config_.max_wait_ms * 1e-3));
  waiting.grey = spare();
  waiting.grey.create(height, width, CV_8UC1);
  std::memcpy(waiting.grey.data, frame.data().data(), static_cast<size_t>(width) * static_cast<size_t>(height));
  views_.add(std::move(waiting));
  views_.expire(core::monotonic_ns());
}

void OdometryService::take_pose(const Waiting& waiting, const msg::TrackView* view, MousePicture& picture) {
  const bool fresh = last_pose_ns_ != 0 && std::abs(waiting.stamp_ns - last_pose_ns_) < kPoseLifeNs;
  picture.pose = fresh ? last_pose_ : mount_;
  picture.curvature_per_m = curvature_per_m_;
  picture.vertical_curvature_per_m = vertical_curvature_per_m_;
  if (view == nullptr || !messaging::has_seen(*view)) return;
  const auto sigma = [view](size_t place) { return std::sqrt(std::max(0.0, view->covariance()[place])); };
  PoseTrust trust;
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) trust.covariance(i, j) = view->covariance()[kPoseCovariance[i][j]];
  }
  if (!(trust.pitch_sigma_rad() < config_.mouse.mount_pitch_sigma_rad)) return;
  if (sigma(messaging::kCurvatureVariance) < kWorstCurvatureSigma) curvature_per_m_ = view->curvature_per_m();
  vertical_curvature_per_m_ = view->vertical_curvature_per_m();
  last_pose_ = {view->roll_rad(), view->pitch_rad(), view->yaw_rad(), view->lateral_m(), view->height_m()};
  last_pose_ns_ = waiting.stamp_ns;
  picture.pose = last_pose_;
  picture.pose_measured = true;
  picture.trust = trust;
  picture.curvature_per_m = curvature_per_m_;
  picture.vertical_curvature_per_m = vertical_curvature_per_m_;
}

void OdometryService::measure(const Waiting& waiting, const msg::TrackView* view) {
  if (!mouse_) {
    context_.health().degraded("no camera_calibration for camera " + config_.camera + " yet: nothing can be measured");
  } else {
    MousePicture picture;
    picture.grey = waiting.grey;
    picture.stamp_ns = waiting.stamp_ns;
    picture.exposure_s = waiting.exposure_s;
    picture.mount_guessed = !mount_known_;
    take_pose(waiting, view, picture);
    if (messaging::why_useless(waiting.health) != nullptr) {
      last_step_.stamp_ns = waiting.stamp_ns;
      last_step_.mode = MouseMode::blind;
      last_step_.valid = false;
    } else {
      last_step_ = mouse_->process(picture);
      watch_stamps(last_step_, waiting);
      last_step_.step_sigma_m *= messaging::sigma_factor(waiting.health);
    }
    if (context_.in_charge()) publish(last_step_, waiting);
    tell(last_step_, waiting.health);
  }
  spare_.push_back(waiting.grey);
}

void OdometryService::publish(const MouseStep& step, const Waiting& waiting) {
  msg::OdometryStep out;
  out.stamp_ns(step.stamp_ns);
  out.reference_stamp_ns(step.reference_stamp_ns);
  out.grabbed_ns(waiting.grabbed_ns);
  out.frame_seq(waiting.frame_seq);
  out.step_m(step.step_m);
  out.lateral_m(step.lateral_m);
  out.yaw_rad(step.yaw_rad);
  out.step_sigma_m(step.step_sigma_m);
  out.yaw_sigma_rad(step.yaw_sigma_rad);
  out.distance_m(step.distance_m);
  out.speed_mps(step.speed_mps);
  out.lateral_speed_mps(step.lateral_speed_mps);
  out.yaw_rate_rps(step.yaw_rate_rps);
  out.height_m(step.height_m);
  out.mode(mode_of(step.mode));
  out.valid(step.valid ? 1 : 0);
  writer_.write(out);
  context_.health().output(waiting.grabbed_ns);
}

// Pictures in the wrong order jump ahead and back. What the train goes while stamps jump is a guess or lost, and a
// distance has no sigma that could say it.
void OdometryService::watch_stamps(const MouseStep& step, const Waiting& waiting) {
  if (step.off_m * last_off_m_ < 0) out_of_order_ns_ = step.stamp_ns;
  last_off_m_ = step.off_m;
  if (step.why == MouseWhy::stamps_jump && waiting.frame_seq == last_measured_seq_ + 1) {
    context_.log().warn(
        "camera {}: stamps jump by {:.2f} s from one picture to the next; the distance over it is a guess",
        config_.camera, core::seconds(waiting.stamp_ns - last_measured_ns_));
  }
  last_measured_seq_ = waiting.frame_seq;
  last_measured_ns_ = waiting.stamp_ns;
}

void OdometryService::tell(const MouseStep& step, uint32_t picture_health) {
  const bool clock_set_back = step.stamp_ns < last_valid_ns_;
  if (step.valid || last_valid_ns_ == 0 || clock_set_back) last_valid_ns_ = step.stamp_ns;
  const char* useless = messaging::why_useless(picture_health);
  const bool blind = step.stamp_ns - last_valid_ns_ > kBlindNs;
  if (blind && useless != nullptr) {
    context_.health().degraded(std::string("blind: ") + useless);
  } else if (blind && step.why != MouseWhy::mount_guessed) {
    context_.health().degraded(sentence_of(step.why));
  } else if (!mount_known_) {
    context_.health().degraded(
        "the camera's mount is not calibrated, so only standstill is told: run railfix calibrate mount");
  } else if (out_of_order_ns_ != 0 && std::abs(step.stamp_ns - out_of_order_ns_) < kBlindNs) {
    context_.health().degraded("the pictures come in the wrong order");
  } else if (step.valid) {
    context_.health().active();
  }
}

}  // namespace railfix::odometry
