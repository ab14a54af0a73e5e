// What somebody in the cab, and the ground, hear of the train while something of it is broken, and whether it is true.
#pragma once

#include <atomic>
#include <map>
#include <mutex>
#include <optional>
#include <set>
#include <string>
#include <thread>
#include <vector>

#include "core/time.hpp"
#include "evaluation/truth.hpp"
#include "ground_link/mqtt_client.hpp"
#include "ground_link/sequence_watch.hpp"
#include "messaging/service_board.hpp"
#include "messaging/topics.hpp"
#include "system/rig.hpp"

namespace railfix::system_test {

/// Of the monotonic clock.
inline double now_s() {
  return core::seconds(core::monotonic_ns());
}

/// What kept the train from being whole, and why, from this moment on; nothing = it was as usual again.
struct InTheWay {
  double from_s = 0;  // monotonic
  std::set<std::string> what;
};

/// What was heard since Observer::begin().
struct Heard {
  double state_gap_s = 0;   // longest pause of train_state
  double report_gap_s = 0;  // ... of train_position_report
  double ground_gap_s = 0;  // ... of new reports at the ground
  uint64_t states = 0;
  uint64_t located = 0;  // of them, which say a place and may be used
  uint64_t outside = 0;  // the interval does not hold the truth although the state is not unusable
  double worst_excess_m = 0;
  double widest_m = 0;              // interval of usable states
  uint64_t not_ok = 0;              // states that say degraded or unusable
  uint64_t reports_lost = 0;        // numbers that no report in the cab had
  uint64_t ground_lost = 0;         // ... at the ground
  double not_whole_s = 0;           // monotonic time of the last moment at which not everything was as usual
  std::vector<InTheWay> course;     // of the way back: where the time went
  std::vector<std::string> said;    // new complaints, in their order
  std::set<std::string> not_usual;  // what keeps the train from being whole now
};

class Observer {
 public:
  Observer(Rig& rig, const std::filesystem::path& truth_folder);
  ~Observer();
  Observer(const Observer&) = delete;
  Observer& operator=(const Observer&) = delete;

  /// Listens for this time.
  void run(double seconds);
  /// Until everything has been as it should for some time; false when that takes too long.
  bool wait_whole(double patience_s);
  /// Everything that is heard from now on counts as part of this fault.
  void begin();
  [[nodiscard]] const Heard& heard() const { return heard_; }
  /// Counts what has not come yet, too.
  Heard end();

  /// By their names: "fusion@cab".
  [[nodiscard]] const messaging::ServiceSeen* service(const std::string& name) const;

 private:
  void state(const msg::TrainState& state, const messaging::SampleInfo& info);
  void report(const msg::TrainPositionReport& report, const messaging::SampleInfo& info);
  void status(const msg::ServiceStatus& status, const messaging::SampleInfo& info);
  void look_for_silence();
  void judge(const msg::TrainState& state);
  void say(const std::string& text);
  void listen_on_the_ground(Rig& rig);
  void ask_monitor();
  void turn();
  void note_course();
  [[nodiscard]] std::set<std::string> not_usual() const;
  [[nodiscard]] std::string with_reason(const std::string& name) const;

  struct Pause {
    double last_s = 0;
    double longest_s = 0;
    void heard(double now_s) {
      if (last_s > 0 && now_s - last_s > longest_s) longest_s = now_s - last_s;
      last_s = now_s;
    }
  };

  evaluation::Truth truth_;
  std::set<std::string> expected_;
  std::unique_ptr<messaging::Participant> participant_;
  messaging::Queue queue_;
  messaging::ServiceBoard services_;
  std::optional<msg::TrainState> state_;
  Pause states_;
  Pause reports_;
  Pause ground_;
  ground_link::SequenceWatch numbers_;  // of the reports on the train, whoever sent them
  Heard heard_;
  std::set<std::string> known_complaints_;
  std::mutex mutex_;  // of what other threads say: the ground's and the monitor's
  ground_link::SequenceWatch sequences_;
  size_t missing_before_ = 0;
  size_t numbers_missing_before_ = 0;
  std::vector<std::string> monitor_said_;
  std::atomic<bool> ended_ = false;
  std::unique_ptr<ground_link::MqttClient> ground_client_;
  std::thread monitor_thread_;
  std::vector<std::shared_ptr<void>> readers_;
};

}  // namespace railfix::system_test
