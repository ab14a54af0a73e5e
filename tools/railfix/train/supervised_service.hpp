// A service of this host's plan, and its process: started, watched, started again.
#pragma once

#include <sys/types.h>

#include <filesystem>
#include <string>

#include "service/service.hpp"
#include "train/plan.hpp"

namespace railfix::tool {

class SupervisedService {
 public:
  /// `beside`: another one of this service runs, which it is to replace.
  SupervisedService(PlannedService service, const HostFolder& folder, const service::CommonConfig& common, bool beside);
  [[nodiscard]] const PlannedService& service() const { return service_; }
  [[nodiscard]] RunningService state() const {
    return {pid_, service_.generation, restarts_, last_end_, beside_, born_, refused_};
  }
  /// It runs already: the supervisor before has started it, and has died.
  void adopt(const RunningService& running);
  [[nodiscard]] bool runs() const { return pid_ > 0; }
  /// Runs well for so long that it has found everybody.
  [[nodiscard]] bool has_found_all() const;
  /// The one that it ran beside has gone.
  void take_its_place();

  /// Starts it when it is time, notes its end. True when something has changed.
  bool turn();
  void ask_to_stop() const;
  void kill_it();
  bool ended();

 private:
  bool has_ended(int& wait_status) const;
  void forget_health() const;
  void look(int64_t now_ns);
  void kill_when_frozen(int64_t now_ns);
  void start(int64_t now_ns);
  bool note_end(int64_t now_ns);

  PlannedService service_;
  std::filesystem::path home_;
  std::filesystem::path log_;
  std::filesystem::path usual_health_;
  std::filesystem::path health_;
  bool beside_ = false;
  int64_t well_since_ns_ = 0;
  int frozen_looks_ = 0;
  int64_t looked_ns_ = 0;
  pid_t pid_ = 0;
  int64_t born_ = 0;
  bool adopted_ = false;  // another process's child
  int restarts_ = 0;
  bool refused_ = false;
  std::string last_end_;  // told to the next process; empty = it is the first one
  std::streamoff log_began_ = 0;
  int64_t started_ns_ = 0;
  int64_t next_start_ns_ = 0;
  int64_t pause_ns_;
};

}  // namespace railfix::tool
