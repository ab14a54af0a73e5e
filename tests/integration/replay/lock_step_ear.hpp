// Takes a turn in lock step itself, so that it hears every position of the train, and keeps their bytes.
#pragma once

#include <map>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "messaging/topics.hpp"
#include "support/on_train.hpp"

namespace railfix::test {

class LockStepEar : OnTrain {
 public:
  static inline const std::string kName = "tpr_publisher";  // whose turn it takes

  LockStepEar(const std::string& train, int domain)
      : OnTrain(train, domain),
        progress_(participant_, messaging::topics::data_progress),
        status_(participant_, messaging::topics::service_status) {
    hear(messaging::topics::train_state);
    hear(messaging::topics::train_pose);
    hear(messaging::topics::position_fix);
    listen(messaging::topics::data_clock, [this](const msg::DataClock& clock) {
      if (clock.lock_step() != 0 && clock.ended() == 0 && kName == clock.turn().c_str()) turn_ = clock;
      ended_ = ended_ || clock.ended() != 0;
    });
  }

  /// False when the replay takes too long.
  bool listen_until_the_end() {
    return run_until([this] {
      say_status();
      answer();
      return ended_;
    });
  }
  [[nodiscard]] const std::map<std::string, std::string>& bytes() const { return bytes_; }
  [[nodiscard]] const std::map<std::string, uint64_t>& samples() const { return received_; }

 private:
  template <class T>
  void hear(const messaging::Topic<T>& topic) {
    heard_.insert(topic.name);
    listen(topic, [this, name = std::string(topic.name)](const T& sample, const messaging::SampleInfo& info) {
      const auto cdr = messaging::serialize(sample);
      bytes_[name].append(cdr.begin(), cdr.end());
      received_[name] = info.sequence;
    });
  }
  void say_status() {
    if (core::monotonic_ns() < status_due_ns_) return;
    status_due_ns_ = core::monotonic_ns() + 250'000'000;
    const auto here = participant_.connections();
    msg::ServiceStatus status;
    status.service(kName);
    status.host("test");
    status.state(msg::STATE_ACTIVE);
    status.endpoints(here.endpoints);
    status.matches(here.matches);
    status_.write(status);
  }
  void answer() {
    if (!turn_) return;
    for (const auto& sent : turn_->sent()) {
      const std::string topic = sent.topic().c_str();
      if (heard_.contains(topic) && received_[topic] < sent.samples()) return;
    }
    msg::DataProgress progress;
    progress.data_ns(turn_->data_ns());
    progress.seq(turn_->seq());
    progress.service(kName);
    turn_.reset();
    progress_.write(progress);
  }

  messaging::Writer<msg::DataProgress> progress_;
  messaging::Writer<msg::ServiceStatus> status_;
  std::optional<msg::DataClock> turn_;
  std::set<std::string> heard_;
  std::map<std::string, uint64_t> received_;
  std::map<std::string, std::string> bytes_;
  int64_t status_due_ns_ = 0;
  bool ended_ = false;
};

}  // namespace railfix::test
