// From messages to what the algorithms take, and back.
#pragma once

#include <algorithm>

#include "map_matcher/inputs.hpp"
#include "messaging/direction.hpp"
#include "messaging/messaging.hpp"
#include "messaging/samples.hpp"

namespace railfix::map_matcher {

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
  return {
      m.stamp_ns(),   m.reference_stamp_ns(), messaging::has_measured(m), m.step_m(), m.yaw_rad(), m.yaw_sigma_rad(),
      m.distance_m(), m.speed_mps()};
}

inline ViewInput input_of(const msg::TrackView& m) {
  return {m.curvature_per_m(), m.covariance()[messaging::kCurvatureVariance]};
}
inline GyroInput input_of(const msg::ImuSample& m) {
  return {m.rate_z_rps()};
}
inline StateInput input_of(const msg::TrainState& m) {
  return {placed(m), m.sigma_m(), m.track_probability(), m.visual_scale(), m.easting_m(), m.northing_m()};
}

/// The first place, with the others as alternatives.
template <typename Places>
msg::PositionFix message_of(const Places& places) {
  msg::PositionFix message;
  message.edge(places.front().place.edge);
  message.offset_m(places.front().place.offset_m);
  message.direction(direction_of(places.front().place.direction));
  message.probability(places.front().probability);
  const size_t others = std::min<size_t>(places.size() - 1, msg::FIX_ALTERNATIVES);
  for (size_t i = 0; i < others; ++i) {
    const auto& other = places[i + 1];
    message.alternative_edge()[i] = other.place.edge;
    message.alternative_offset_m()[i] = other.place.offset_m;
    message.alternative_probability()[i] = other.probability;
    message.alternative_direction()[i] = direction_of(other.place.direction);
  }
  message.alternatives(static_cast<uint8_t>(others));
  return message;
}

}  // namespace railfix::map_matcher
