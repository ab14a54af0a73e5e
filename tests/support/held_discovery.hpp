// A middleware that has been at one message of the discovery ever since: it waits for itself.
#pragma once

#include <future>
#include <mutex>
#include <thread>

#include "messaging/participant.hpp"

namespace railfix::test {

class HeldDiscovery {
 public:
  explicit HeldDiscovery(messaging::Participant& participant)
      : thread_([this, &discovery = *participant.impl().discovery] {
          const std::lock_guard one_message(discovery);
          held_.set_value();
          enough_.get_future().wait();
        }) {
    held_.get_future().wait();
  }
  ~HeldDiscovery() {
    enough_.set_value();
    thread_.join();
  }
  HeldDiscovery(const HeldDiscovery&) = delete;
  HeldDiscovery& operator=(const HeldDiscovery&) = delete;

 private:
  std::promise<void> held_;
  std::promise<void> enough_;
  std::thread thread_;  // last: it uses the others
};

}  // namespace railfix::test
