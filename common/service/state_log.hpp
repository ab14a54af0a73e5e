// What a service's log says of how it is: each trouble when it begins and when it is over, in few lines where they come
// and go.
#pragma once

#include <cstdint>
#include <optional>
#include <string>

namespace railfix::service {

class StateLog {
 public:
  struct Line {
    bool trouble = false;
    std::string text;
  };
  /// What to write now, if anything; to be asked whenever it may have changed, and now and then. State: STATE_*.
  std::optional<Line> follow(uint8_t state, const std::string& reason, int64_t monotonic_ns);

 private:
  std::string now_;   // the trouble there is, without its numbers; empty = well
  std::string said_;  // ... as the log has it
  int changes_ = 0;   // since the last line
  std::optional<int64_t> said_ns_;
};

}  // namespace railfix::service
