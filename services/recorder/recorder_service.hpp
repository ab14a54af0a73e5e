// The recorder as a service: commands, status and log around the recorder.
#pragma once

#include "recorder/recorder.hpp"
#include "recorder/recorder_config.hpp"
#include "service/service.hpp"

namespace railfix::recorder {

class RecorderService {
 public:
  using Config = RecorderConfig;
  RecorderService(const Config& config, service::Context& context);

 private:
  [[nodiscard]] std::map<std::string, std::string> about() const;
  void add_commands();
  void warn_if_unreadable(const std::string& file);
  core::Result<std::string> logged(core::Result<std::string> done);
  core::Result<std::string> start(const std::string& file);
  core::Result<std::string> stop();
  void show_state();
  void note_losses(const RecorderState& now);
  void show_health(const RecorderState& now);
  void publish(const RecorderState& now);

  Config config_;
  service::Context& context_;
  messaging::Writer<msg::RecorderStatus> status_;
  int64_t recorded_ns_ = INT64_MIN;  // pictures up to here are in the file (lock step)
  Recorder recorder_;
  uint64_t received_ = 0;
  uint64_t written_ = 0;
  uint64_t lost_ = 0;
  uint64_t lost_here_ = 0;      // of these, by this recorder
  int64_t loses_until_ns_ = 0;  // shown so long
  int64_t lost_on_way_told_ns_ = 0;
  std::string losses_;  // as they were then: a new file begins at none
  msg::RecorderStatus published_;
  int64_t published_ns_ = 0;
};

}  // namespace railfix::recorder
