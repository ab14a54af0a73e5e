// The recorder as a service: commands start and stop, status and log around the recorder's threads.
#pragma once

#include "recorder/recorder_config.hpp"
#include "recorder/recorder_thread.hpp"
#include "service/service.hpp"

namespace railfix::recorder {

class RecorderService {
 public:
  using Config = RecorderConfig;
  RecorderService(const Config& config, service::Context& context);

 private:
  [[nodiscard]] std::map<std::string, std::string> about() const;
  core::Result<std::string> start(const std::string& file);
  core::Result<std::string> stop();
  void show_state();

  Config config_;
  service::Context& context_;
  int64_t recorded_ns_ = INT64_MIN;  // pictures up to here are in the file (lock step)
  RecorderThread thread_;
  uint64_t received_ = 0;
  uint64_t written_ = 0;
  uint64_t lost_ = 0;
  int64_t lost_last_ns_ = 0;
  std::string problem_;
};

}  // namespace railfix::recorder
