#include "recording/topic_summary.hpp"

#include <algorithm>
#include <array>
#include <string_view>

#include "core/time.hpp"
#include "messaging/topics.hpp"
#include "recording/sample_types.hpp"

namespace railfix::tool {

namespace {

namespace topics = messaging::topics;

constexpr double kStartS = 1;

double mean_gap_s(const mcap::ChannelContent& content) {
  return content.messages < 2
             ? 0
             : core::seconds(content.last_ns - content.first_ns) / static_cast<double>(content.messages - 1);
}

}  // namespace

bool periodic(const mcap::Channel& channel) {
  static constexpr std::array<std::string_view, 5> kEvents{topics::log_record.name, topics::landmark_sighting.name,
                                                           topics::position_fix.name, topics::service_control.name,
                                                           topics::service_reply.name};
  return !latched(channel) && std::ranges::find(kEvents, channel.topic) == kEvents.end();
}

TopicSummary summary_of(const mcap::Channel& channel, const mcap::ChannelContent& content, const RecordedTime& whole) {
  TopicSummary summary;
  summary.periodic = periodic(channel);
  summary.begins_s = core::seconds(content.first_ns - whole.start_ns);
  summary.ends_s = core::seconds(content.last_ns - whole.start_ns);
  summary.between_s = summary.longest_gap_s = core::seconds(content.longest_gap_ns);
  const double length_s = core::seconds(whole.end_ns - whole.start_ns);
  const double silent_s = length_s - summary.ends_s;
  const double apart_s = mean_gap_s(content);
  const double usual_s = summary.periodic ? std::max(kStartS, 2 * apart_s) : kStartS;
  summary.begins_late = summary.begins_s > usual_s;
  summary.ends_early = silent_s > usual_s;
  if (summary.periodic) summary.longest_gap_s = std::max({summary.longest_gap_s, summary.begins_s, silent_s});
  if (summary.periodic && apart_s > 0) {
    summary.rate_hz = 1 / apart_s;
  } else if (length_s > 0) {
    summary.rate_hz = static_cast<double>(content.messages) / length_s;
  }
  return summary;
}

}  // namespace railfix::tool
