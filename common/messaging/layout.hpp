// Private to this folder: which layout of a topic's type a writer and a reader were compiled with. Two that differ
// would match (types have no version, and no TypeObject: Cyclone DDS 0.10 refuses those) and one would read nonsense,
// so every endpoint says it in its user data.
#pragma once

#include <cstdint>
#include <vector>

#include "messaging/messaging.hpp"

namespace railfix::messaging {

/// Of the topic's IDL file, whatever its comments and spaces are; 0 = that file is not compiled in.
uint64_t layout_of(const TopicInfo& topic);

std::vector<uint8_t> user_data_of_layout(uint64_t layout);
/// 0 = it says none: another program than ours.
uint64_t layout_in(const std::vector<uint8_t>& user_data);
/// As far as both say it.
inline bool fits(uint64_t layout, uint64_t other) {
  return layout == 0 || other == 0 || layout == other;
}

}  // namespace railfix::messaging
