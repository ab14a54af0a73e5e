#include "fusion/fusion_service.hpp"

#include <chrono>
#include <cmath>

#include "core/time.hpp"

namespace railfix::fusion {
namespace {

using messaging::topics::data_clock;
using messaging::topics::gnss_fix;
using messaging::topics::imu_sample;
using messaging::topics::odometry_step;
using messaging::topics::position_fix;
using messaging::topics::train_pose;
using messaging::topics::train_state;
using messaging::topics::wheel_sample;

constexpr std::chrono::milliseconds kTickPeriod{50};
constexpr double kLiveDataS = 5.0;  // data stamps further from the host's clock are not live

Fusion make_fusion(const FusionConfig& config, const std::shared_ptr<const track::Map>& map) {
  std::optional<track::EdgePosition> start;
  if (config.start != "unknown") {
    if (!map)
      throw core::BadInput("fusion.start is a place on a map, but fusion.map is empty: give a map or start: unknown");
    start = core::value_or_throw(map->parse_position(config.start));
  }
  return core::value_or_throw(Fusion::create(config.parameters, map, start));
}

OdometryInput input_of(const msg::OdometryStep& m) {
  return {m.stamp_ns(), m.reference_stamp_ns(), m.step_m(), m.step_sigma_m(),
          m.valid() != 0 && m.mode() != msg::ODOMETRY_BLIND};
}
FixInput input_of(const msg::PositionFix& m) {
  FixInput fix;
  fix.stamp_ns = m.stamp_ns();
  fix.edge = m.edge();
  fix.offset_m = m.offset_m();
  fix.sigma_m = m.sigma_m();
  fix.probability = m.probability();
  fix.landmark = m.landmark();
  fix.kind = m.kind() == msg::FIX_CURVATURE ? FixKind::curvature
             : m.kind() == msg::FIX_NETWORK ? FixKind::network
             : m.kind() == msg::FIX_TRACK   ? FixKind::track
                                            : FixKind::landmark;
  fix.direction = m.direction() == msg::DIRECTION_REVERSE ? track::Direction::reverse : track::Direction::forward;
  return fix;
}

msg::TrainState message_of(const TrainEstimate& e) {
  msg::TrainState m;
  m.stamp_ns(e.stamp_ns);
  m.offset_m(e.position.offset_m);
  m.distance_m(e.distance_m);
  m.speed_mps(e.speed_mps);
  m.acceleration_mps2(e.acceleration_mps2);
  m.over_m(e.over_m);
  m.under_m(e.under_m);
  m.sigma_m(e.sigma_m);
  m.visual_scale(e.visual_scale);
  m.wheel_scale(e.wheel_scale);
  m.since_reference_m(e.since_reference_m);
  m.lat_deg(e.lat_deg);
  m.lon_deg(e.lon_deg);
  m.easting_m(e.easting_m);
  m.northing_m(e.northing_m);
  m.heading_rad(e.heading_rad);
  m.track_probability(e.track_probability);
  m.edge(e.track_known ? e.position.edge : 0);
  m.reference(e.reference);
  m.sources(e.sources);
  m.direction(!e.track_known                                      ? msg::DIRECTION_UNKNOWN
              : e.position.direction == track::Direction::reverse ? msg::DIRECTION_REVERSE
                                                                  : msg::DIRECTION_FORWARD);
  m.track_known(e.track_known ? 1 : 0);
  m.integrity(static_cast<uint8_t>(e.integrity));
  m.standstill(e.standstill ? 1 : 0);
  return m;
}

BodySample body_sample_of(const msg::ImuSample& m) {
  return {m.stamp_ns(),
          {m.rate_x_rps(), m.rate_y_rps(), m.rate_z_rps()},
          {m.accel_x_mps2(), m.accel_y_mps2(), m.accel_z_mps2()}};
}

msg::TrainPose message_of(const PoseEstimate& p) {
  msg::TrainPose m;
  m.stamp_ns(p.stamp_ns);
  m.easting_m(p.easting_m);
  m.northing_m(p.northing_m);
  m.height_m(p.height_m);
  m.along_sigma_m(p.along_sigma_m);
  m.across_sigma_m(p.across_sigma_m);
  m.height_sigma_m(p.height_sigma_m);
  m.heading_rad(p.heading_rad);
  m.pitch_rad(p.pitch_rad);
  m.roll_rad(p.roll_rad);
  m.heading_sigma_rad(p.heading_sigma_rad);
  m.pitch_sigma_rad(p.pitch_sigma_rad);
  m.roll_sigma_rad(p.roll_sigma_rad);
  m.orientation(p.from_imu ? msg::ORIENTATION_IMU : msg::ORIENTATION_TRACK);
  return m;
}

}  // namespace

FusionService::FusionService(const FusionConfig& config, service::Context& context)
    : context_(context),
      writer_(context.writer(train_state)),
      pose_writer_(context.writer(train_pose)),
      pose_(config.parameters.gnss_map_sigma_m) {
  if (!config.map.empty()) {
    map_ = std::make_shared<const track::Map>(core::value_or_throw(track::Map::load(config.map)));
  }
  fusion_.emplace(make_fusion(config, map_));
  listen(config);
  context_.on<msg::DataClock>(data_clock, [this](const msg::DataClock& m) { keep_time(m); });
  context_.every(kTickPeriod, [this] { tick(); });
  context_.health().ready();
}

void FusionService::listen(const FusionConfig& config) {
  if (config.use_wheel) {
    context_.on<msg::WheelSample>(wheel_sample, [this](const msg::WheelSample& m) {
      use(WheelInput{m.stamp_ns(), m.pulses(), m.pulses_per_metre()}, m.grabbed_ns());
    });
  }
  if (config.use_imu) {
    context_.on<msg::ImuSample>(imu_sample, [this](const msg::ImuSample& m) {
      pose_.add(body_sample_of(m));
      use(ImuInput{m.stamp_ns(), m.accel_x_mps2(), m.rate_z_rps()}, m.grabbed_ns());
    });
  }
  if (config.use_gnss) context_.on<msg::GnssFix>(gnss_fix, [this](const msg::GnssFix& m) { use_gnss(m); });
  if (config.use_camera) {
    context_.on<msg::OdometryStep>(odometry_step,
                                   [this](const msg::OdometryStep& m) { use(input_of(m), m.grabbed_ns()); });
  }
  if (config.use_fixes) {
    context_.on<msg::PositionFix>(position_fix, [this](const msg::PositionFix& m) { use(input_of(m), 0); });
  }
}

void FusionService::use_gnss(const msg::GnssFix& sample) {
  if (!map_) return;
  const auto place = map_->from_geo({sample.lat_deg(), sample.lon_deg()});
  if (!place) {
    if (!no_projection_told_) context_.log().warn("GNSS is not used: the map has no coordinate system (crs)");
    no_projection_told_ = true;
    return;
  }
  use(GnssInput{sample.stamp_ns(), place->x(), place->y(), sample.hdop(), sample.fix()}, sample.grabbed_ns());
}

void FusionService::use(const Event& event, int64_t grabbed_ns) {
  context_.health().input();
  if (const auto estimate = fusion_->add(event)) publish(*estimate, grabbed_ns);
}

void FusionService::keep_time(const msg::DataClock& clock) {
  clock_ = clock;
  if (clock.ended() != 0) return;
  if (const auto estimate = fusion_->tick(clock.data_ns())) publish(*estimate, 0);
}

// When nothing comes any more the interval must still grow. Lock step knows no time but that of the data.
void FusionService::tick() {
  if (clock_ && (clock_->lock_step() != 0 || clock_->ended() != 0)) return;
  const auto latest_ns = fusion_->latest_stamp_ns();
  if (!latest_ns) return;
  const int64_t wall_ns = core::wall_ns();
  const int64_t now_ns = clock_ ? clock_->data_ns() + wall_ns - clock_->wall_ns() : wall_ns;
  live_ = live_ || clock_ || std::abs(core::seconds(now_ns - *latest_ns)) < kLiveDataS;
  if (!live_) return;
  if (const auto estimate = fusion_->tick(now_ns)) publish(*estimate, 0);
}

void FusionService::publish(const TrainEstimate& estimate, int64_t grabbed_ns) {
  msg::TrainState message = message_of(estimate);
  message.seq(++seq_);
  message.grabbed_ns(grabbed_ns);
  if (!writer_.write(message)) context_.health().dropped(1);
  if (estimate.track_known) publish_pose(estimate);
  context_.health().output(grabbed_ns);
  if (estimate.integrity == Integrity::ok) {
    context_.health().active();
  } else {
    context_.health().degraded(estimate.reason);
  }
}

void FusionService::publish_pose(const TrainEstimate& estimate) {
  const auto* estimator = fusion_->estimator();
  const bool imu_healthy = !estimator->watch(Source::imu).isolated;
  if (!pose_writer_.write(message_of(pose_.at(estimate, *estimator->path(), imu_healthy))))
    context_.health().dropped(1);
}

}  // namespace railfix::fusion
