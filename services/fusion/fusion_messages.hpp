// From messages to what fusion takes, and back.
#pragma once

#include <algorithm>

#include "fusion/fusion.hpp"
#include "fusion/handover.hpp"
#include "fusion/train_pose.hpp"
#include "messaging/direction.hpp"
#include "messaging/messaging.hpp"
#include "messaging/samples.hpp"
#include "messaging/topics.hpp"

namespace railfix::fusion {

static_assert(static_cast<uint8_t>(FixKind::curvature) == msg::FIX_CURVATURE);
static_assert(static_cast<uint8_t>(FixKind::landmark) == msg::FIX_LANDMARK);
static_assert(static_cast<uint8_t>(FixKind::network) == msg::FIX_NETWORK);
static_assert(static_cast<uint8_t>(FixKind::track) == msg::FIX_TRACK);
static_assert(static_cast<uint8_t>(FixKind::gnss) == msg::FIX_GNSS);
static_assert(static_cast<uint8_t>(Integrity::ok) == msg::INTEGRITY_OK);
static_assert(static_cast<uint8_t>(Integrity::degraded) == msg::INTEGRITY_DEGRADED);
static_assert(static_cast<uint8_t>(Integrity::unusable) == msg::INTEGRITY_UNUSABLE);
static_assert(1U << static_cast<unsigned>(Source::camera) == msg::SOURCE_CAMERA);
static_assert(1U << static_cast<unsigned>(Source::wheel) == msg::SOURCE_WHEEL);
static_assert(1U << static_cast<unsigned>(Source::imu) == msg::SOURCE_IMU);
static_assert(1U << static_cast<unsigned>(Source::gnss) == msg::SOURCE_GNSS);
static_assert(1U << static_cast<unsigned>(Source::landmark) == msg::SOURCE_LANDMARK);
static_assert(1U << static_cast<unsigned>(Source::curvature) == msg::SOURCE_CURVATURE);

inline OdometryInput input_of(const msg::OdometryStep& m) {
  return {m.stamp_ns(), m.reference_stamp_ns(), m.step_m(), m.step_sigma_m(), messaging::has_measured(m),
          m.yaw_rad(),  m.yaw_sigma_rad()};
}
/// Other places on the track that a fix says: ways of another length have led there.
inline void hold_other_places(const msg::PositionFix& m, FixInput& fix) {
  const double along = fix.direction == track::Direction::reverse ? -1.0 : 1.0;
  const size_t count = std::min<size_t>(m.alternatives(), msg::FIX_ALTERNATIVES);
  for (size_t i = 0; i < count; ++i) {
    const bool here = m.alternative_edge()[i] == m.edge() && m.alternative_direction()[i] == m.direction();
    if (!here) continue;
    const double further_m = along * (m.alternative_offset_m()[i] - m.offset_m());
    fix.otherwise.hold({-further_m, further_m});
  }
}

inline FixInput input_of(const msg::PositionFix& m) {
  FixInput fix;
  fix.stamp_ns = m.stamp_ns();
  const auto place = messaging::place_of(m);
  fix.edge = place.edge;
  fix.offset_m = place.offset_m;
  fix.direction = place.direction;
  fix.sigma_m = m.sigma_m();
  fix.probability = m.probability();
  fix.landmark = m.landmark();
  fix.kind = static_cast<FixKind>(m.kind());
  fix.sightings_fit = m.sightings_fit() == msg::SIGHTINGS_FIT_HERE      ? SightingsFit::here
                      : m.sightings_fit() == msg::SIGHTINGS_FIT_NOWHERE ? SightingsFit::nowhere
                                                                        : SightingsFit::not_told;
  if (fix.kind == FixKind::track) hold_other_places(m, fix);
  return fix;
}

inline msg::TrainState message_of(const TrainEstimate& e) {
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
  m.direction(messaging::direction_of(e.track_known ? e.position.direction : track::Direction::unknown));
  m.track_known(e.track_known ? 1 : 0);
  m.integrity(static_cast<uint8_t>(e.integrity));
  m.standstill(e.standstill ? 1 : 0);
  return m;
}

inline BodySample body_sample_of(const msg::ImuSample& m) {
  return {m.stamp_ns(),
          {m.rate_x_rps(), m.rate_y_rps(), m.rate_z_rps()},
          {m.accel_x_mps2(), m.accel_y_mps2(), m.accel_z_mps2()}};
}

inline msg::TrainPose message_of(const PoseEstimate& p) {
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

inline KnownPlace known_place_of(const msg::TrainState& m, bool in_doubt) {
  return {m.stamp_ns(),
          messaging::place_of(m),
          m.speed_mps(),
          m.over_m(),
          m.under_m(),
          m.track_probability(),
          m.integrity() != msg::INTEGRITY_OK,
          in_doubt,
          messaging::pose_of(m)};
}

inline const char* topic_of(const Event& event) {
  if (std::holds_alternative<ImuInput>(event)) return messaging::topics::imu_sample.name;
  if (std::holds_alternative<WheelInput>(event)) return messaging::topics::wheel_sample.name;
  if (std::holds_alternative<GnssInput>(event)) return messaging::topics::gnss_fix.name;
  return std::holds_alternative<FixInput>(event) ? messaging::topics::position_fix.name
                                                 : messaging::topics::odometry_step.name;
}

}  // namespace railfix::fusion
