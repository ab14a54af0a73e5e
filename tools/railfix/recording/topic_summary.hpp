// When a topic of a recording was heard, how often, and how long it was silent.
#pragma once

#include "mcap/check.hpp"

namespace railfix::tool {

/// The whole recording, from its first sample of any topic to its last.
struct RecordedTime {
  int64_t start_ns = 0;
  int64_t end_ns = 0;
};

struct TopicSummary {
  bool periodic = false;     // else it speaks when something happens, and silence says nothing
  double rate_hz = 0;        // periodic: while it was heard; else over the whole recording
  double longest_gap_s = 0;  // periodic: begin and end of the recording are ends of gaps, too
  double between_s = 0;      // the longest gap between its samples alone
  double begins_s = 0;       // into the recording
  double ends_s = 0;
  bool begins_late = false;  // by more than a start takes ...
  bool ends_early = false;   // ... and than its samples are apart
};

/// Every topic is, but standing values and what tells of events: log records, sightings, fixes, commands.
bool periodic(const mcap::Channel& channel);

/// REQUIRES: content has messages.
TopicSummary summary_of(const mcap::Channel& channel, const mcap::ChannelContent& content, const RecordedTime& whole);

}  // namespace railfix::tool
