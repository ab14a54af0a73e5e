// Watches the services of one run over DDS: are all there and connected, start, how far is it, has the data ended.
#pragma once

#include <map>
#include <optional>
#include <string>
#include <vector>

#include "messaging/service_board.hpp"
#include "messaging/topics.hpp"
#include "run/processes.hpp"

namespace railfix::tool {

/// The newest of everything that a person wants to see.
struct TrainPicture {
  messaging::ServiceBoard services;
  std::optional<msg::TrainState> state;
  std::optional<msg::TrainPositionReport> report;
  uint64_t reports = 0;
  uint64_t sightings = 0;
  uint64_t views = 0;
  uint64_t views_seen = 0;
  int64_t data_begin_ns = 0;
  int64_t data_ns = 0;           // of the newest odometry step or, without a camera, state
  std::vector<std::string> log;  // the last warnings and errors
  bool recorded = false;
  bool recording_broke_off = false;  // and the train ran on without it, for a while at least

  void note_time(int64_t stamp_ns);
  /// Never seen, failed, stopped, or silent.
  [[nodiscard]] bool gone(const std::string& service) const;
};

class Supervisor {
 public:
  Supervisor(const messaging::ParticipantOptions& options, std::vector<std::string> services);

  /// Every service is ready and every reader has found every writer, or a sentence on what is missing.
  core::Status wait_connected(Processes& processes, double patience_s);
  /// Sends a command and waits for the answer.
  core::Result<std::string> command(Processes& processes, const std::string& service, const std::string& command,
                                    const std::string& argument, double patience_s);
  /// Handles what has come; returns after at most this time.
  void turn(double seconds);
  /// The data has ended, or who sends it is lost, and every service that is not lost has used what it got.
  [[nodiscard]] bool drained(const std::string& source) const;
  /// Of the services: those that nobody waits for, because they have failed, stopped or been silent for some seconds.
  [[nodiscard]] std::vector<std::string> lost() const;
  [[nodiscard]] const TrainPicture& picture() const { return picture_; }

 private:
  [[nodiscard]] std::string missing() const;
  [[nodiscard]] bool is_lost(const std::string& service) const;
  void note_status(const msg::ServiceStatus& status);

  std::vector<std::string> services_;
  messaging::Participant participant_;
  messaging::Queue queue_;
  TrainPicture picture_;
  std::map<uint64_t, msg::ControlReply> replies_;
  uint64_t next_request_ = 1;
  bool ended_ = false;
  std::map<std::string, uint64_t> work_done_;  // frames in + out at the last status
  std::map<std::string, int> unchanged_;       // statuses since then without new work
  messaging::Writer<msg::ControlRequest> control_;
  std::vector<std::shared_ptr<void>> readers_;
};

}  // namespace railfix::tool
