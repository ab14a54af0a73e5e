// A test that leads real services in lock step: what they have heard is counted, so how busy the machine is decides
// nothing.
#pragma once

#include <algorithm>
#include <map>
#include <memory>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "messaging/connected.hpp"
#include "messaging/lock_step.hpp"
#include "support/on_train.hpp"
#include "support/program.hpp"

namespace railfix::test {

/// A fixture inherits it, and writes with its participant_ what the services hear.
class InLockStep : public OnTrain {
 protected:
  InLockStep(std::string train, int64_t domain) : OnTrain(std::move(train), domain), domain_(domain) {
    listen(messaging::topics::data_progress, [this](const msg::DataProgress& progress) { progress_ = progress; });
    listen(messaging::topics::service_status,
           [this](const msg::ServiceStatus& status) { statuses_[status.service().c_str()] = status; });
  }

  /// `service` is what it calls itself ("map_matcher"). It runs until the fixture goes.
  void start(const std::string& service, std::vector<std::string> settings) {
    settings.insert(settings.end(), {"common.train_id=" + train_, "common.domain=" + std::to_string(domain_),
                                     "common.log_level=error", "common.lock_step=true"});
    std::string program = "railfix-" + service;
    std::ranges::replace(program, '_', '-');
    services_.push_back(std::make_unique<Program>(with_settings(program, settings)));
  }
  /// What was started has found everybody, so that no sample is lost; false when that takes too long.
  bool connected() {
    return run_until([this] {
      return statuses_.size() == services_.size() && messaging::all_connected(participant_.connections(), statuses_);
    });
  }

  /// Gives each its turn, one after the other, with what was sent so far. Throws when one takes too long, since nothing
  /// after that would mean anything.
  void give_turns(const std::vector<std::string>& services, int64_t data_ns) {
    ++step_;
    sent_.note(messaging::sent_samples(participant_));
    for (const auto& service : services) {
      msg::DataClock clock;
      clock.data_ns(data_ns);
      clock.seq(step_);
      clock.lock_step(1);
      clock.turn(service);
      sent_.say(clock);
      clock_.write(clock);
      if (!run_until([&] { return progress_.seq() == step_ && service == progress_.service().c_str(); }))
        throw std::runtime_error(service + " has not taken its turn of step " + std::to_string(step_));
      sent_.note(progress_.sent());
    }
  }
  /// Waits for what the turns have brought: `heard` are all samples of the topic that this test has kept.
  template <class Samples>
  void hear_all(const std::string& topic, const Samples& heard) {
    if (!run_until([&] { return heard.size() >= sent_.samples(topic); }))
      throw std::runtime_error("not every " + topic + " has come by step " + std::to_string(step_));
  }
  [[nodiscard]] const msg::ServiceStatus& status(const std::string& service) const { return statuses_.at(service); }

 private:
  const int64_t domain_;
  messaging::Writer<msg::DataClock> clock_{participant_, messaging::topics::data_clock};
  msg::DataProgress progress_;
  messaging::SentTotals sent_;
  uint64_t step_ = 0;
  std::map<std::string, msg::ServiceStatus> statuses_;
  std::vector<std::unique_ptr<Program>> services_;
};

}  // namespace railfix::test
