// How many samples of a topic never came, from the numbers that its writers give them.
#pragma once

#include <algorithm>
#include <cstdint>
#include <map>
#include <utility>

namespace railfix::core {

class SequenceGaps {
 public:
  /// Samples of this writer that are missing right before this one; 0 for its first. `exclusive`: of several writers
  /// one is heard at a time, and the numbers of the others go on meanwhile, which is no loss.
  uint64_t before(uint64_t writer, uint64_t sequence, bool exclusive) {
    const bool taken_over = std::exchange(heard_, writer) != writer;
    const auto [last, first] = last_.try_emplace(writer, sequence);
    const uint64_t next = last->second + 1;
    last->second = std::max(last->second, sequence);
    return first || sequence <= next || (exclusive && taken_over) ? 0 : sequence - next;
  }

 private:
  std::map<uint64_t, uint64_t> last_;  // of each writer
  uint64_t heard_ = 0;
};

}  // namespace railfix::core
