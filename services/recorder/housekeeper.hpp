// Looks after the folder of the recordings in a thread of its own: the quota, and what the folder holds. Removing a
// large file takes a while, and no sample must wait for it.
#pragma once

#include <chrono>
#include <condition_variable>
#include <mutex>
#include <thread>

#include "recorder/recordings_folder.hpp"

namespace railfix::recorder {

class Housekeeper {
 public:
  /// `quota_bytes` 0: nothing is ever removed.
  Housekeeper(std::filesystem::path folder, uint64_t quota_bytes);
  ~Housekeeper();
  Housekeeper(const Housekeeper&) = delete;
  Housekeeper& operator=(const Housekeeper&) = delete;

  // Any thread.
  [[nodiscard]] Survey survey() const;
  /// What was removed or could not be kept, since the last call.
  std::vector<std::string> take_sentences();
  core::Result<std::string> protect(const std::string& name, const std::string& why);
  core::Result<std::string> unprotect(const std::string& name);

 private:
  void look();
  void say(const std::string& sentence);

  std::filesystem::path folder_;
  uint64_t quota_bytes_;
  std::mutex files_mutex_;  // held while files are removed or protected
  bool over_quota_said_ = false;

  mutable std::mutex mutex_;
  std::condition_variable woken_;
  bool ending_ = false;
  Survey survey_;
  std::vector<std::string> sentences_;
  std::thread thread_;
};

}  // namespace railfix::recorder
