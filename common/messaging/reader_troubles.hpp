// What the middleware itself says went wrong at a participant's readers, since each was made.
#pragma once

#include <cstdint>
#include <map>
#include <string>

#include "messaging/messaging.hpp"

namespace railfix::messaging {

struct ReaderTroubles {
  uint64_t rejected = 0;          // samples that its limits had no room for
  uint64_t deadlines_missed = 0;  // periods in which the topic's deadline passed without a sample
};

/// By topic ("train_state"); the sum where a topic has several readers.
std::map<std::string, ReaderTroubles> reader_troubles(Participant& participant);

}  // namespace railfix::messaging
