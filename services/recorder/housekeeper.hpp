// Looks after the folder of the recordings in a thread of its own: the quota, what a crash left, and what the folder
// holds. Removing a large file takes a while, recovering one minutes, and no sample must wait for it.
#pragma once

#include <atomic>
#include <chrono>
#include <condition_variable>
#include <mutex>
#include <thread>

#include "recorder/recordings_folder.hpp"

namespace railfix::recorder {

struct FolderRules {
  uint64_t quota_bytes = 0;      // 0: nothing is ever removed
  uint64_t keep_free_bytes = 0;  // below it recording stops, so recovering stops before
  bool recovers = false;         // what a crash left in the folder is ours
};

class Housekeeper {
 public:
  /// Only what is cut off now is ever recovered, so to be made before anything is recorded.
  Housekeeper(std::filesystem::path folder, const FolderRules& rules);
  ~Housekeeper();
  Housekeeper(const Housekeeper&) = delete;
  Housekeeper& operator=(const Housekeeper&) = delete;

  // Any thread.
  [[nodiscard]] Survey survey() const;
  /// What was removed or could not be kept, since the last call.
  std::vector<std::string> take_sentences();
  /// What somebody should know: of what a crash left, and of what cannot be done.
  std::vector<std::string> take_warnings();
  /// Begins to recover what a crash left, one file after the other, the newest first. One without room is tried again
  /// when there is.
  void recover();
  /// The file that is being recovered; empty = none.
  [[nodiscard]] std::string recovering() const;
  core::Result<std::string> protect(const std::string& name, const std::string& why);
  core::Result<std::string> unprotect(const std::string& name);

 private:
  void run();
  void look();
  struct CutOff {
    enum class State { new_to_us, without_room, beyond_recovery };
    std::filesystem::path file;
    State state = State::new_to_us;
  };
  [[nodiscard]] std::vector<CutOff>::iterator next_to_recover();
  void recover_next();
  [[nodiscard]] CutOff::State recovery_ended(const std::filesystem::path& file, const core::Error& why);
  [[nodiscard]] uint64_t room_for(const std::filesystem::path& cut_off) const;
  [[nodiscard]] bool makes_room_for(const std::filesystem::path& cut_off);
  bool goes_on();
  void say(const std::string& sentence);
  void warn(const std::string& sentence);

  std::filesystem::path folder_;
  FolderRules rules_;
  std::vector<CutOff> cut_off_;  // without the one that is being recovered
  int64_t looked_ns_ = 0;
  bool disk_filled_ = false;  // while a file was recovered
  std::mutex files_mutex_;    // held while files are removed or protected
  bool over_quota_said_ = false;

  mutable std::mutex mutex_;
  std::condition_variable woken_;
  std::atomic<bool> ending_ = false;
  std::atomic<bool> recovers_ = false;
  std::string recovering_;
  Survey survey_;
  std::vector<std::string> sentences_;
  std::vector<std::string> warnings_;
  std::thread thread_;
};

}  // namespace railfix::recorder
