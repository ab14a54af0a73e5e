// What a service says of itself to its own host, beside service_status: health checks of containers and service
// managers ask this file, because joining the train's network every few seconds would cost more than the service.
#pragma once

#include <filesystem>
#include <optional>
#include <string>

#include "idl/operation.h"
#include "service/service.hpp"

namespace railfix::service {

/// In the host's shared memory, one a service, host and train.
std::filesystem::path health_path(const CommonConfig& common, const std::string& service);

/// Of one that was started beside another one; renamed to the above by whoever started it once that one has gone.
std::filesystem::path health_path_beside(const CommonConfig& common, const std::string& service);

/// What has gone through a service, on the host's monotonic clock; 0 = nothing yet.
struct Traffic {
  Flow flow = Flow::sporadic;
  bool stands_by = false;      // another one sends
  int64_t input_since_ns = 0;  // without a gap of kFlowGapNs
  int64_t last_input_ns = 0;
  int64_t last_output_ns = 0;
};
inline constexpr int64_t kFlowGapNs = 2'000'000'000;

class HealthFile {
 public:
  explicit HealthFile(std::filesystem::path path);
  ~HealthFile();
  HealthFile(const HealthFile&) = delete;
  HealthFile& operator=(const HealthFile&) = delete;

  /// Over what stood there; takes memory at the first call only, so that a full /dev/shm later does not silence it.
  /// What cannot be written is left out: the check says so.
  void write(const msg::ServiceStatus& status, const Traffic& traffic = {}, const std::string& serves = "");
  /// The same words are true now; nothing before the first ones.
  void beat();

 private:
  std::filesystem::path path_;
  int file_ = -1;
  std::string words_;
};

/// How long ago the service said something there; nothing when it never did.
std::optional<int64_t> silent_ns(const std::filesystem::path& path);

struct HealthAnswer {
  bool healthy = false;
  bool starting = false;  // it does not wait for input yet
  bool degraded = false;
  bool stands_by = false;
  bool sends = false;  // one that sends steadily has done so within the last two seconds
  bool stuck = false;  // one that answers every input has had input for two seconds and answered none of it
  std::optional<double> input_s = {};  // since the last input; nothing before the first
  std::string text;                    // one sentence
  std::string serves = {};             // address of its page; empty = it has none, or does not say it
  /// What an operator calls well.
  [[nodiscard]] bool works() const { return healthy && !stuck; }
};
/// Healthy: its run loop turned within the last two seconds and it has not failed. Degraded is healthy: a restart would
/// not help; so is stuck: a camera may lack its calibration still.
HealthAnswer ask_health(const std::filesystem::path& path);

}  // namespace railfix::service
