// From messages to what the publisher takes, and back.
#pragma once

#include <algorithm>
#include <cmath>
#include <string>

#include "messaging/direction.hpp"
#include "messaging/onboard_topic.hpp"
#include "messaging/samples.hpp"
#include "messaging/topics.hpp"
#include "tpr_publisher/tpr_publisher.hpp"
#include "track/same_map.hpp"

namespace railfix::tpr_publisher {

static_assert(static_cast<uint8_t>(Reason::cycle_time) == msg::REPORT_CYCLE_TIME);
static_assert(static_cast<uint8_t>(Reason::cycle_distance) == msg::REPORT_CYCLE_DISTANCE);
static_assert(static_cast<uint8_t>(Reason::standstill) == msg::REPORT_STANDSTILL);
static_assert(static_cast<uint8_t>(Reason::moving) == msg::REPORT_MOVING);
static_assert(static_cast<uint8_t>(Reason::balise_group) == msg::REPORT_BALISE_GROUP);
static_assert(static_cast<uint8_t>(Reason::location) == msg::REPORT_LOCATION);
static_assert(static_cast<uint8_t>(Reason::start) == msg::REPORT_START);
static_assert(static_cast<uint8_t>(Reason::mode) == msg::REPORT_MODE);
static_assert(static_cast<uint8_t>(Reason::level) == msg::REPORT_LEVEL);
static_assert(static_cast<uint8_t>(Reason::integrity_confirmed) == msg::REPORT_INTEGRITY_CONFIRMED);
static_assert(static_cast<uint8_t>(Reason::integrity_lost) == msg::REPORT_INTEGRITY_LOST);
static_assert(static_cast<uint8_t>(Reason::border) == msg::REPORT_BORDER);
static_assert(static_cast<uint8_t>(Reason::session) == msg::REPORT_SESSION);
static_assert(static_cast<uint8_t>(Reason::error) == msg::REPORT_ERROR);

inline bool of_another_map(const track::Map* map, const msg::TrainState& state) {
  return map != nullptr && state.track_known() != 0 &&
         !track::lies_there(*map, messaging::place_of(state), messaging::pose_of(state));
}

inline TrainPosition position_of(const track::Map* map, const msg::TrainState& state) {
  TrainPosition position;
  position.stamp_ns = state.stamp_ns();
  position.foot = messaging::place_of(state);
  position.track_known = state.track_known() != 0 && !of_another_map(map, state);
  position.track_probability = state.track_probability();
  position.usable = state.integrity() != msg::INTEGRITY_UNUSABLE;
  position.distance_m = state.distance_m();
  position.speed_mps = state.speed_mps();
  position.over_m = state.over_m();
  position.under_m = state.under_m();
  position.standstill = state.standstill() != 0;
  return position;
}

struct HeardOnboard {
  Onboard onboard;
  std::string refusal;  // what of it is no value; empty = nothing
};

/// What is no value says nothing, and all the rest counts. A report that is wanted for no reason that we know is
/// wanted.
inline HeardOnboard onboard_of(const msg::OnboardStatus& status) {
  HeardOnboard heard;
  const auto value = [&](uint32_t said, const char* name, uint32_t least, uint32_t most, uint32_t otherwise) {
    if (said >= least && said <= most) return said;
    if (heard.refusal.empty())
      heard.refusal = std::string(name) + " is " + std::to_string(said) + ", not " + std::to_string(least) + " to " +
                      std::to_string(most) + ".";
    return otherwise;
  };
  auto& onboard = heard.onboard;
  onboard.stamp_ns = status.stamp_ns();
  onboard.integrity_ns = status.integrity_ns();
  onboard.train_length_m = status.train_length_m();
  onboard.m_mode = status.m_mode();
  onboard.m_level = status.m_level();
  onboard.nid_ntc = status.nid_ntc();
  onboard.q_integrity = value(status.q_integrity(), "q_integrity", 0, 3, etcs::kNoIntegrityInformation);
  onboard.active_cab = static_cast<ActiveCab>(value(status.active_cab(), "active_cab", 0, 2, 0));
  value(status.packet_58_lrbg(), "packet_58_lrbg", 0, etcs::kUnknownBaliseGroup, 0);
  onboard.reports_wanted = status.reports_wanted();
  if (onboard.reports_wanted != 0)
    onboard.wanted_because = static_cast<Reason>(
        value(status.wanted_because(), "wanted_because", msg::REPORT_BORDER, msg::REPORT_ERROR, msg::REPORT_SESSION));
  return heard;
}

/// The values of the message, as it says them.
inline msg::TrainPositionReport message_of(const Report& report, etcs::Baseline baseline) {
  const auto& fields = report.fields;
  const auto metres = [&](uint32_t raw) { return etcs::metres_if_known(raw, fields.q_scale).value_or(std::nan("")); };
  msg::TrainPositionReport message;
  message.stamp_ns(report.stamp_ns);
  message.sent_ns(report.sent_ns);
  message.d_lrbg_m(metres(fields.d_lrbg));
  message.l_doubtover_m(metres(fields.l_doubtover));
  message.l_doubtunder_m(metres(fields.l_doubtunder));
  message.v_train_kmh(fields.v_train == etcs::kStandstillSpeed ? 0.0 : fields.v_train * etcs::kSpeedStepKmh);
  message.nid_engine(fields.nid_engine);
  message.nid_lrbg(fields.nid_lrbg);
  message.nid_prvlrbg(fields.nid_prvlrbg.value_or(etcs::kUnknownBaliseGroup));
  message.nid_packet(static_cast<uint8_t>(fields.nid_packet));
  message.q_dirlrbg(static_cast<uint8_t>(fields.q_dirlrbg));
  message.q_dlrbg(static_cast<uint8_t>(fields.q_dlrbg));
  message.q_dirtrain(static_cast<uint8_t>(fields.q_dirtrain));
  message.baseline(static_cast<uint8_t>(baseline));
  message.reason(static_cast<uint8_t>(report.reason));
  message.message_bytes(static_cast<uint32_t>(report.message.size()));
  std::copy(report.message.begin(), report.message.end(), message.message().begin());
  return message;
}

}  // namespace railfix::tpr_publisher
