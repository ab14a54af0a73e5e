// The position reports of the last time, whoever sent them. What a writer has kept comes again to a monitor that starts
// later, in any order with what another one sends now.
#pragma once

#include <deque>
#include <nlohmann/json.hpp>

#include "idl/position.h"

namespace railfix::monitor {

class ReportList {
 public:
  /// True: it is the newest one. `received_ns` by this host's clock: one that is later than that by seconds, and not of
  /// somebody whose clock is always so, was sent before a clock was set back, and goes.
  bool take(const msg::TrainPositionReport& report, int64_t received_ns);
  void clear() { reports_.clear(); }
  /// As messages for the page, the newest one last.
  [[nodiscard]] std::vector<nlohmann::json> messages() const;

 private:
  struct Kept {
    int64_t sent_ns = 0;
    nlohmann::json message;
  };
  std::deque<Kept> reports_;  // by the time when they were sent
};

}  // namespace railfix::monitor
