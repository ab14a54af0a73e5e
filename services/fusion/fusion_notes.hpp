// What is known from another fusion: the state that the one in charge has sent, or that the process before has
// noted.
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "messaging/topics.hpp"

namespace railfix::fusion {

struct KnownState {
  msg::TrainState state;
  bool in_doubt = false;              // something spoke against its place
  std::optional<int64_t> noted_ns{};  // when the process before has noted it, monotonic; nothing = it was heard
};

/// As notes for the next process; `kept_for`: the map and the start that they are for.
std::string to_notes(const std::string& kept_for, const KnownState& known);
/// Nothing where they are for another map or start, or are none.
std::optional<KnownState> from_notes(const std::string& kept_for, const std::string& notes);

}  // namespace railfix::fusion
