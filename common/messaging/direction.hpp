// Places and the direction along an edge in which a train looks, as position messages and as the map say it.
#pragma once

#include "idl/position.h"
#include "track/map.hpp"

namespace railfix::messaging {

/// Of DIRECTION_*; any other value is unknown.
constexpr track::Direction direction_of(uint8_t said) {
  if (said == msg::DIRECTION_FORWARD) return track::Direction::forward;
  return said == msg::DIRECTION_REVERSE ? track::Direction::reverse : track::Direction::unknown;
}

constexpr uint8_t direction_of(track::Direction direction) {
  if (direction == track::Direction::forward) return msg::DIRECTION_FORWARD;
  return direction == track::Direction::reverse ? msg::DIRECTION_REVERSE : msg::DIRECTION_UNKNOWN;
}

/// Where a train is by its state. REQUIRES: track_known, for it to mean anything.
inline track::EdgePosition place_of(const msg::TrainState& state) {
  return {state.edge(), state.offset_m(), direction_of(state.direction())};
}
inline track::EdgePosition place_of(const msg::PositionFix& fix) {
  return {fix.edge(), fix.offset_m(), direction_of(fix.direction())};
}

/// The same on the plane of the sender's map, for track::lies_there.
template <class Message>
track::PlanPose pose_of(const Message& message) {
  return {message.easting_m(), message.northing_m(), message.heading_rad()};
}

}  // namespace railfix::messaging
