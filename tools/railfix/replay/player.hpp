// Plays a recording to a train: by the clock or in lock step, led by commands on service_control and telling on
// player_status where it is.
#pragma once

#include <atomic>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "recording/sample_types.hpp"
#include "replay/channel_choice.hpp"
#include "replay/lock_step_leader.hpp"
#include "replay/sample_feed.hpp"
#include "replay/timeline.hpp"

namespace railfix::tool {

/// How the samples left, against their own time.
struct ReplayReport {
  uint64_t samples = 0;
  size_t topics = 0;
  double late_p50_ms = 0;  // sent later than due; not in lock step
  double late_p99_ms = 0;
  double late_max_ms = 0;
  std::vector<std::string> problems;  // a sentence each
};

class Player {
 public:
  /// Throws BadInput when the file cannot be replayed so.
  explicit Player(const ReplayOptions& options);
  ~Player();
  Player(const Player&) = delete;
  Player& operator=(const Player&) = delete;

  /// Finds the others, plays until the end, and gives what was done. Without a reason to stop (a file that loops or
  /// waits for commands) until stop().
  ReplayReport run();
  /// Any thread, any time; safe in a signal handler.
  void stop() { stopped_ = true; }
  /// As on service_control. Any thread: it is carried out in run().
  void post(const std::string& name, const std::string& argument);
  /// Called about ten times a second, in run().
  void on_status(std::function<void(const msg::PlayerStatus&)> handler) { on_status_ = std::move(handler); }

 private:
  using Command = std::function<core::Result<std::string>(const std::string& argument)>;
  // player_setup.cpp
  void find_part();
  void discover();
  void open_channels();
  void open_clock();
  void connect();
  // player_commands.cpp
  std::map<std::string, Command> make_commands();
  core::Result<std::string> carry_out(const std::string& name, const std::string& argument);
  void answer(const msg::ControlRequest& request);
  core::Result<std::string> play();
  core::Result<std::string> seek(const std::string& argument);
  core::Result<std::string> set_rate(const std::string& argument);
  void wake_promptly() const;

  // player.cpp
  void go_to(int64_t at_ns);
  void restart_clock(int64_t at_ns);
  void send_standing_values(int64_t at_ns);
  void seek_now();
  [[nodiscard]] std::set<std::string> recorded_names() const;
  void play_on();
  bool hold_back(int64_t now_ns);
  bool wait_for_turns();
  void send();
  void publish(const PreparedSample& sample);
  void at_end();
  bool prepare(const mcap::Channel& channel, const mcap::Message& message, PreparedSample& sample);
  void serve(int64_t until_ns);
  void say_status(int64_t now_ns);
  void publish_status();
  void publish_clock(bool ended);
  [[nodiscard]] int64_t at_ns() const;
  [[nodiscard]] ReplayReport report();

  ReplayOptions options_;
  std::unique_ptr<mcap::Reader> reader_;
  SampleTypes types_;
  /// The player waits for locks that the middleware's threads hold, so they are made as prompt as it is.
  struct PromptThreads {
    explicit PromptThreads(const ReplayOptions& options);
  } prompt_threads_;
  messaging::Participant participant_;
  messaging::Queue queue_;
  std::optional<LockStepLeader> leader_;
  frame_grabber::Gathering gathering_;
  std::map<std::string, Command> commands_;
  messaging::Writer<msg::PlayerStatus> status_;
  messaging::Writer<msg::ControlReply> replies_;
  messaging::Reader<msg::ControlRequest> requests_;
  std::optional<messaging::Writer<msg::DataClock>> clock_;  // not in lock step, nor beside a clock of now
  std::unique_ptr<messaging::Reader<msg::ServiceStatus>> services_;
  std::set<std::string> live_services_;
  std::function<void(const msg::PlayerStatus&)> on_status_;

  std::vector<ReplayedChannel> channels_;
  std::map<std::string, size_t> channel_of_;  // by recorded name
  std::optional<size_t> frame_channel_;       // what a step ends with
  int64_t from_ns_ = 0;
  int64_t to_ns_ = 0;  // of the last sample
  Timeline timeline_;
  uint8_t state_ = msg::PLAYER_PAUSED;
  bool stepping_ = false;
  std::atomic<bool> stopped_ = false;
  std::optional<int64_t> seek_to_;  // as soon as everyone has had their turn
  std::unique_ptr<SampleFeed> feed_;
  std::optional<PreparedSample> next_;
  int64_t sent_to_ns_ = 0;    // log time of the last sample
  size_t unused_ = 0;         // lock step: samples sent that nobody had a turn for
  int64_t data_ns_ = 0;       // stamp of the newest picture, or what stands for it, 0 = none yet
  int64_t data_time_ns_ = 0;  // its log time
  uint64_t clocks_ = 0;       // sent
  std::optional<int64_t> waiting_since_ns_;
  int64_t status_due_ns_ = 0;
  int64_t begun_ns_ = 0;

  std::vector<float> late_ms_;
  std::map<std::string, uint64_t> unreadable_;  // by recorded name; the feed's while there is one
  std::map<std::string, uint64_t> unsent_;
  std::vector<std::string> left_out_;
  uint64_t published_ = 0;
};

}  // namespace railfix::tool
