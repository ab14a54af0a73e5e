// What held at a moment of a recording without being said at that moment: the last values of latched topics.
#pragma once

#include <map>
#include <set>
#include <string>
#include <vector>

#include "recording/sample_types.hpp"

namespace railfix::tool {

struct StandingValue {
  uint16_t channel_id = 0;
  uint32_t sequence = 0;
  int64_t log_time_ns = 0;
  int64_t publish_time_ns = 0;
  std::vector<uint8_t> cdr;
};

/// The last value of every latched topic (and of every instance, where it is keyed) before this log time, in the order
/// of their log times. `topics` as in mcap::Selection. Of service_status only what was said in the last
/// ten seconds.
std::vector<StandingValue> standing_values(mcap::Reader& reader, const std::set<std::string>& topics,
                                           int64_t before_ns);

}  // namespace railfix::tool
