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
  /// The one that it ran beside has gone. False: it has not said a word yet, and would say it under its present name.
  bool take_its_place();

  /// Starts it when it is time, notes its end. True when something has changed.
  bool turn();

  /// From now on turn_to_end() takes the place of turn().
  void ask_to_end();
  /// Kills it when it takes its time, and lets the engine remove what is left; waits for nothing. True when nothing is
  /// left.
  bool turn_to_end();
  /// Was asked to end and may still do something: nothing of its name is to be started. A process that was killed and
  /// is held by the kernel (a disk or a device does not answer) will do nothing any more.
  [[nodiscard]] bool is_in_the_way() const;
  [[nodiscard]] bool is_beside() const { return beside_; }

 private:
  bool has_ended(int& wait_status) const;
  void insist(int64_t now_ns);
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
  int64_t asked_ns_ = 0;   // to end
  bool insisted_ = false;  // on that
  int64_t killed_ns_ = 0;  // it and its clean-up: nothing more can be done
  pid_t cleaner_ = 0;
};

}  // namespace railfix::tool
