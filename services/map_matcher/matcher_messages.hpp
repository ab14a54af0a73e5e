// From messages to what the algorithms take, and back.
#pragma once

#include <algorithm>
#include <cstdint>

#include "map_matcher/inputs.hpp"
#include "map_matcher/map_matcher.hpp"
#include "messaging/direction.hpp"
#include "messaging/messaging.hpp"
#include "messaging/samples.hpp"
#include "messaging/topics.hpp"
#include "track/ways.hpp"

namespace railfix::map_matcher {

static_assert(static_cast<uint8_t>(track::LandmarkKind::frog) == msg::SIGHTING_FROG);
static_assert(static_cast<uint8_t>(track::LandmarkKind::balise) == msg::SIGHTING_BALISE);
static_assert(static_cast<uint8_t>(track::LandmarkKind::portal_in) == msg::SIGHTING_PORTAL_IN);
static_assert(static_cast<uint8_t>(track::LandmarkKind::portal_out) == msg::SIGHTING_PORTAL_OUT);
static_assert(static_cast<uint8_t>(track::LandmarkKind::mast) == msg::SIGHTING_MAST);
static_assert(static_cast<uint8_t>(track::LandmarkKind::bridge) == msg::SIGHTING_BRIDGE);
static_assert(static_cast<uint8_t>(track::LandmarkKind::platform) == msg::SIGHTING_PLATFORM);
static_assert(static_cast<uint8_t>(SightingsFit::nowhere) == msg::SIGHTINGS_FIT_NOWHERE);
static_assert(static_cast<uint8_t>(SightingsFit::here) == msg::SIGHTINGS_FIT_HERE);

using messaging::direction_of;
using messaging::place_of;

inline PlacedTrain placed(const msg::TrainState& m) {
  return {m.stamp_ns(), place_of(m), m.speed_mps(), m.distance_m(), m.over_m(), m.under_m()};
}
inline Sighting input_of(const msg::LandmarkSighting& m) {
  return {m.stamp_ns(),  static_cast<track::LandmarkKind>(m.kind()), m.distance_ahead_m(), m.lateral_m(), m.sigma_m(),
          m.confidence()};
}
inline StepInput input_of(const msg::OdometryStep& m) {
  return {.stamp_ns = m.stamp_ns(),
          .reference_stamp_ns = m.reference_stamp_ns(),
          .measured = messaging::has_measured(m),
          .step_m = m.step_m(),
          .yaw_rad = m.yaw_rad(),
          .yaw_sigma_rad = m.yaw_sigma_rad(),
          .distance_m = m.distance_m(),
          .speed_mps = m.speed_mps(),
          .frame_to_frame = m.mode() == msg::ODOMETRY_TRACK};
}
inline ViewInput input_of(const msg::TrackView& m) {
  return {m.curvature_per_m(), m.covariance()[messaging::kCurvatureVariance], m.stamp_ns()};
}
inline GyroInput input_of(const msg::ImuSample& m) {
  return {m.rate_z_rps(), m.stamp_ns()};
}
inline StateInput input_of(const msg::TrainState& m) {
  return {.placed = placed(m),
          .sigma_m = m.sigma_m(),
          .track_probability = m.track_probability(),
          .visual_scale = m.visual_scale(),
          .pose = messaging::pose_of(m),
          .track_known = m.track_known() != 0,
          .usable = m.integrity() != msg::INTEGRITY_UNUSABLE,
          .standstill = m.standstill() != 0,
          .gnss_agrees = (m.sources() & msg::SOURCE_GNSS) != 0,
          .camera_agrees = (m.sources() & msg::SOURCE_CAMERA) != 0};
}

inline uint8_t kind_of(FixKind kind) {
  switch (kind) {
    case FixKind::landmark:
      return msg::FIX_LANDMARK;
    case FixKind::curvature:
      return msg::FIX_CURVATURE;
    case FixKind::track:
      return msg::FIX_TRACK;
    case FixKind::network:
      return msg::FIX_NETWORK;
    case FixKind::gnss:
      break;
  }
  return msg::FIX_GNSS;
}

inline msg::PositionFix message_of(const track::Map& map, const PlaceFix& fix) {
  msg::PositionFix message;
  message.stamp_ns(fix.stamp_ns);
  message.kind(kind_of(fix.kind));
  message.sigma_m(fix.sigma_m);
  message.landmark(fix.landmark);
  message.sightings_fit(static_cast<uint8_t>(fix.sightings_fit));
  const auto& best = fix.options.front();
  message.edge(best.place.edge);
  message.offset_m(best.place.offset_m);
  message.direction(direction_of(best.place.direction));
  message.probability(best.probability);
  const track::PlanPose pose = track::cab_pose(map, best.place);
  message.easting_m(pose.easting_m);
  message.northing_m(pose.northing_m);
  message.heading_rad(pose.heading_rad);
  const size_t others = std::min<size_t>(fix.options.size() - 1, msg::FIX_ALTERNATIVES);
  for (size_t i = 0; i < others; ++i) {
    const auto& other = fix.options[i + 1];
    message.alternative_edge()[i] = other.place.edge;
    message.alternative_offset_m()[i] = other.place.offset_m;
    message.alternative_probability()[i] = other.probability;
    message.alternative_direction()[i] = direction_of(other.place.direction);
  }
  message.alternatives(static_cast<uint8_t>(others));
  return message;
}

}  // namespace railfix::map_matcher
