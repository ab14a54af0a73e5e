#include "track_detector/track_detector_service.hpp"

#include <algorithm>
#include <array>
#include <cmath>

#include "core/time.hpp"
#include "core/units.hpp"
#include "messaging/camera.hpp"

namespace railfix::track_detector {
namespace {

constexpr int64_t kDriftSaidNs = 5 * core::kNsPerSecond;  // its numbers change with every picture
constexpr int64_t kBlindNs = core::kNsPerSecond;
constexpr double kUnknownMountFactor = 3.0;  // how much wider the limits are while the mount is a guess

struct RailArrays {
  std::array<float, msg::TRACK_EDGE_POINTS> u_px{};
  std::array<float, msg::TRACK_EDGE_POINTS> v_px{};
  uint32_t count = 0;
};

/// Up to 16 points of one rail, evenly over all of them.
RailArrays points_of(const TrackObservation& observation, Side side) {
  // The left rail's come first.
  const auto on_side = [side](const EdgePoint& point) { return point.side == side; };
  const auto first = std::find_if(observation.points.begin(), observation.points.end(), on_side);
  const auto size = static_cast<size_t>(std::count_if(first, observation.points.end(), on_side));
  RailArrays arrays;
  arrays.count = static_cast<uint32_t>(std::min(size, arrays.u_px.size()));
  for (uint32_t i = 0; i < arrays.count; ++i) {
    const auto& point = first[static_cast<ptrdiff_t>(arrays.count < 2 ? 0 : i * (size - 1) / (arrays.count - 1))].pixel;
    arrays.u_px[i] = static_cast<float>(point.x());
    arrays.v_px[i] = static_cast<float>(point.y());
  }
  return arrays;
}

std::array<double, 28> upper_triangle(const Eigen::Matrix<double, 7, 7>& covariance) {
  std::array<double, 28> packed{};
  size_t k = 0;
  for (int r = 0; r < 7; ++r) {
    for (int c = r; c < 7; ++c) packed[k++] = covariance(r, c);
  }
  return packed;
}

}  // namespace

TrackDetectorService::TrackDetectorService(const Config& config, service::Context& context)
    : config_(config),
      context_(context),
      writer_(context.writer(messaging::topics::track_view)),
      sighting_writer_(context.writer(messaging::topics::landmark_sighting)) {
  context_.health().flows(service::Flow::answers);
  context_.on<msg::CameraCalibration>(messaging::topics::camera_calibration, [this](const msg::CameraCalibration& c) {
    const bool known = calibration_ && messaging::serialize(*calibration_) == messaging::serialize(c);
    if (!known) calibrated(c);  // a frame_grabber begun anew says it once more
  });
  context_.on<msg::CameraFrame>(
      messaging::topics::camera_frame, [this](const msg::CameraFrame& frame) { pictured(frame); }, config_.camera);
  if (config_.imu_roll.use) {
    context_.on<msg::ImuSample>(messaging::topics::imu_sample, [this](const msg::ImuSample& sample) {
      if (imu_roll_) imu_roll_->add(sample.stamp_ns(), sample.rate_x_rps());
    });
  }
  context_.at_restart([this](int64_t) { restart(); });
  context_.share_charge();
  context_.health().ready();
}

void TrackDetectorService::restart() {
  last_seq_ = 0;
  last_stamp_ns_ = 0;
  last_seen_ns_ = 0;
  drift_.clear();
  drift_ns_ = 0;
  if (calibration_) calibrated(msg::CameraCalibration(*calibration_));
}

void TrackDetectorService::calibrated(const msg::CameraCalibration& c) {
  if (config_.camera != c.camera().c_str()) return;
  calibration_ = c;
  const geometry::Intrinsics camera = messaging::intrinsics_of(c);
  const geometry::CameraPose mount = messaging::mount_of(c);
  detector_.reset();
  why_unusable_ = messaging::why_unusable(c);
  if (why_unusable_ != nullptr) {
    context_.health().degraded(unusable());
    return;
  }
  mount_known_ = c.mount_known();
  DetectorOptions options = config_.detector;
  if (!mount_known_) {
    for (double* sigma : {&options.limits.roll_rad, &options.limits.pitch_rad, &options.limits.yaw_rad,
                          &options.limits.lateral_m, &options.limits.height_m}) {
      *sigma *= kUnknownMountFactor;
    }
  }
  detector_ = std::make_unique<TrackDetector>(camera, mount, options);
  finder_ = std::make_unique<LandmarkFinder>(camera, config_.landmarks);
  imu_roll_ = std::make_unique<ImuRoll>(config_.imu_roll, mount, options.limits.roll_rad);
  watch_ = std::make_unique<MountWatch>(detector_->mount(), options.limits);
  context_.log().info("camera {} {}x{}, {:.2f} m above the rails, pitch {:.2f} deg", config_.camera, camera.width_px,
                      camera.height_px, mount.height_m, core::deg_from_rad(mount.pitch_rad));
}

std::string TrackDetectorService::unusable() const {
  if (why_unusable_ == nullptr)
    return "no camera_calibration for camera " + config_.camera + " yet: no rails can be found";
  return "calibration unusable: " + std::string(why_unusable_) + " (camera " + config_.camera +
         "); run railfix calibrate mount";
}

void TrackDetectorService::pictured(const msg::CameraFrame& frame) {
  context_.health().input();
  if (last_seq_ != 0 && frame.seq() > last_seq_ + 1) context_.health().dropped(frame.seq() - last_seq_ - 1);
  last_seq_ = frame.seq();
  if (!detector_) {
    context_.health().degraded(unusable());
  } else if (static_cast<int>(frame.width_px()) != detector_->camera().width_px ||
             static_cast<int>(frame.height_px()) != detector_->camera().height_px) {
    context_.health().degraded("pictures of camera " + config_.camera +
                               " have another size than its camera_calibration");
  } else {
    detect(frame);
  }
}

void TrackDetectorService::detect(const msg::CameraFrame& frame) {
  // The picture is only read; cv::Mat has no constant view of foreign memory.
  auto* pixels = const_cast<uint8_t*>(frame.data().data());  // NOLINT(cppcoreguidelines-pro-type-const-cast)
  const cv::Mat grey(static_cast<int>(frame.height_px()), static_cast<int>(frame.width_px()), CV_8UC1, pixels);
  TrackObservation& observation = observation_;
  if (const char* why = messaging::why_useless(frame.health())) {
    observation = detector_->not_seen(why);
  } else {
    observation = detector_->detect(grey, imu_roll_->at(frame.stamp_ns()));
  }
  const double factor = messaging::sigma_factor(frame.health());
  observation.covariance *= factor * factor;
  if (observation.seen()) {
    watch_->add(observation.shape, std::sqrt(observation.covariance(5, 5)),
                core::seconds(frame.stamp_ns() - last_stamp_ns_));
  }
  last_stamp_ns_ = frame.stamp_ns();
  if (context_.in_charge()) publish(observation, frame);
  if (observation.seen()) find_landmarks(grey, observation, frame);
  tell(observation, frame.stamp_ns());
}

void TrackDetectorService::publish(const TrackObservation& observation, const msg::CameraFrame& frame) {
  msg::TrackView out;
  out.stamp_ns(frame.stamp_ns());
  out.grabbed_ns(frame.grabbed_ns());
  out.frame_seq(frame.seq());
  const auto& pose = observation.shape.camera;
  out.roll_rad(pose.roll_rad);
  out.pitch_rad(pose.pitch_rad);
  out.yaw_rad(pose.yaw_rad);
  out.lateral_m(pose.lateral_m);
  out.height_m(pose.height_m);
  out.curvature_per_m(observation.shape.curvature_per_m);
  out.vertical_curvature_per_m(observation.shape.vertical_curvature_per_m);
  out.covariance(upper_triangle(observation.covariance));
  out.condition(observation.condition);
  if (observation.seen_left) {
    const auto left = points_of(observation, Side::left);
    out.left_u_px(left.u_px);
    out.left_v_px(left.v_px);
    out.left_points(left.count);
  }
  if (observation.seen_right) {
    const auto right = points_of(observation, Side::right);
    out.right_u_px(right.u_px);
    out.right_v_px(right.v_px);
    out.right_points(right.count);
  }
  out.residual_px(static_cast<float>(observation.residual_px));
  out.confidence(static_cast<float>(observation.confidence));
  out.seen_left(observation.seen_left ? 1 : 0);
  out.seen_right(observation.seen_right ? 1 : 0);
  out.mount_drifted(watch_->drifted() ? 1 : 0);
  writer_.write(out);
  context_.health().output(frame.grabbed_ns());
}

void TrackDetectorService::find_landmarks(const cv::Mat& grey, const TrackObservation& observation,
                                          const msg::CameraFrame& frame) {
  LandmarkPicture picture;
  picture.grey = grey;
  picture.stamp_ns = frame.stamp_ns();
  picture.pose = observation.shape.camera;
  picture.sigma_factor = messaging::sigma_factor(frame.health());
  picture.pitch_sigma_rad = std::sqrt(observation.covariance(1, 1)) / picture.sigma_factor;
  picture.curvature_per_m = observation.shape.curvature_per_m;
  picture.vertical_curvature_per_m = observation.shape.vertical_curvature_per_m;
  picture.frame_seq = frame.seq();
  picture.grabbed_ns = frame.grabbed_ns();
  for (const Sighting& sighting : finder_->process(picture)) {
    msg::LandmarkSighting out;
    out.stamp_ns(sighting.stamp_ns);
    out.grabbed_ns(sighting.grabbed_ns);
    out.frame_seq(sighting.frame_seq);
    out.distance_ahead_m(sighting.distance_ahead_m);
    out.lateral_m(sighting.lateral_m);
    out.sigma_m(sighting.sigma_m);
    out.confidence(sighting.confidence);
    out.kind(static_cast<uint8_t>(sighting.type));
    if (context_.in_charge()) sighting_writer_.write(out);
  }
}

void TrackDetectorService::tell(const TrackObservation& observation, int64_t stamp_ns) {
  const bool clock_set_back = stamp_ns < last_seen_ns_;
  if (observation.seen() || last_seen_ns_ == 0 || clock_set_back) last_seen_ns_ = stamp_ns;
  if (stamp_ns - drift_ns_ > kDriftSaidNs || stamp_ns < drift_ns_) {
    drift_ = watch_->what_drifted();
    drift_ns_ = stamp_ns;
  }
  if (stamp_ns - last_seen_ns_ > kBlindNs) {
    context_.health().degraded("rails not seen: " + observation.reason);
  } else if (!mount_known_) {
    context_.health().degraded("the camera's mount is not calibrated: run railfix calibrate mount");
  } else if (!drift_.empty()) {
    context_.health().degraded("the camera has moved in its mount: " + drift_ + "; run railfix calibrate mount again");
  } else if (observation.seen()) {
    context_.health().active();
  }
}

}  // namespace railfix::track_detector
