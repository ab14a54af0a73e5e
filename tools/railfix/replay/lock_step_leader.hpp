// Leads services through recorded data in lock step, as frame_grabber does with a dataset: everything up to a picture
// is sent, then each service has its turn, then the next.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "frame_grabber/pace.hpp"
#include "messaging/lock_step.hpp"
#include "messaging/topics.hpp"

namespace railfix::tool {

class LockStepLeader {
 public:
  /// Services in any order; they take turns in the order of the data's way. Throws BadInput for one that is none of
  /// ours.
  LockStepLeader(messaging::Participant& participant, messaging::Queue& queue,
                 const std::vector<std::string>& services);

  /// The next step is the first of data that begins anew. REQUIRES: done().
  void restart() { lock_step_ = frame_grabber::LockStep(services_); }
  /// Gives everyone their turn with what was sent so far.
  void begin(int64_t data_ns);
  [[nodiscard]] bool done() const { return lock_step_.done(); }
  /// REQUIRES: not done().
  [[nodiscard]] const std::string& waiting_for() const { return lock_step_.turn(); }
  /// Says that there is no more data.
  void end();

 private:
  void give_turn();
  void answered(const msg::DataProgress& progress);
  void publish(bool ended);
  messaging::Participant& participant_;
  std::vector<std::string> services_;  // in the order of their turns
  frame_grabber::LockStep lock_step_;
  messaging::Writer<msg::DataClock> clock_;
  messaging::Reader<msg::DataProgress> progress_;
  messaging::SentTotals sent_;
  int64_t data_ns_ = 0;
};

}  // namespace railfix::tool
