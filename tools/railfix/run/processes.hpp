// The service programs of one run as child processes, each with its log file.
#pragma once

#include <sys/types.h>

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "core/result.hpp"

namespace railfix::tool {

struct ServiceProgram {
  std::string service;            // "track_detector"
  std::filesystem::path program;  // ".../railfix-track-detector"
  bool needed = true;             // false: a run goes on without it
};

/// The programs of all services that `railfix run` starts, beside the running program, in the order of the data.
core::Result<std::vector<ServiceProgram>> find_service_programs();

class Processes {
 public:
  /// Logs go to log_dir/<service>.log.
  explicit Processes(std::filesystem::path log_dir);
  /// Ends whatever still runs; only the recorder gets its time.
  ~Processes();
  Processes(const Processes&) = delete;
  Processes& operator=(const Processes&) = delete;

  core::Status start(const ServiceProgram& program, const std::vector<std::string>& arguments);
  /// A sentence on the first needed service that has ended by itself, with the last lines of its log.
  [[nodiscard]] std::optional<std::string> unexpected_end();
  /// SIGTERM, then waits; SIGKILL for those that have not ended after the patience. Names those.
  core::Status stop(const std::vector<std::string>& services, double patience_s);
  /// All of them; the recorder goes last, so that it hears everyone's last words, and always gets the time to close its
  /// file.
  core::Status stop_all(double patience_s);
  [[nodiscard]] std::vector<std::string> running() const;

 private:
  struct Child {
    std::string service;
    bool needed = true;
    pid_t pid = -1;
    bool ended = false;
    int wait_status = 0;
  };
  void reap();
  [[nodiscard]] std::string log_tail(const std::string& service) const;
  std::filesystem::path log_dir_;
  std::vector<Child> children_;
};

}  // namespace railfix::tool
