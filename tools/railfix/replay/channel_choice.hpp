// Which channels of a recording are replayed, and as what.
#pragma once

#include <set>
#include <string>
#include <vector>

#include "mcap/reader.hpp"
#include "messaging/topics.hpp"
#include "replay/replay_options.hpp"

namespace railfix::tool {

struct ChosenChannel {
  std::string recorded_as;
  std::string written_as;
  const messaging::TopicInfo* topic = nullptr;
  bool as_jpeg = false;
  uint64_t messages = 0;
};

struct ChannelChoice {
  std::vector<ChosenChannel> channels;
  std::vector<std::string> left_out;  // a sentence each
};

/// `written` are the topics that somebody writes now. In lock step these are left out: the services work them out
/// again. Else throws BadInput when one of them is to be replayed: two writers would give the train two positions.
ChannelChoice choose_channels(const mcap::Reader& reader, const ReplayOptions& options,
                              const std::vector<std::string>& written);

}  // namespace railfix::tool
