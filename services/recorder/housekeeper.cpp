#include "recorder/housekeeper.hpp"

#include <utility>

namespace railfix::recorder {

namespace {

constexpr std::chrono::seconds kPeriod{2};

}  // namespace

Housekeeper::Housekeeper(std::filesystem::path folder, uint64_t quota_bytes)
    : folder_(std::move(folder)), quota_bytes_(quota_bytes) {
  thread_ = std::thread([this] {
    std::unique_lock lock(mutex_);
    while (!ending_) {
      lock.unlock();
      try {
        look();
      } catch (const std::exception& error) {
        say(folder_.string() + " cannot be looked after: " + error.what());
      }
      lock.lock();
      woken_.wait_for(lock, kPeriod, [this] { return ending_; });
    }
  });
}

Housekeeper::~Housekeeper() {
  {
    const std::lock_guard lock(mutex_);
    ending_ = true;
  }
  woken_.notify_all();
  thread_.join();
}

void Housekeeper::look() {
  Survey seen;
  {
    const std::lock_guard files(files_mutex_);
    if (quota_bytes_ > 0) {
      for (const auto& sentence : keep_quota(folder_, quota_bytes_)) say(sentence);
    }
    seen = recorder::survey(folder_);
  }
  const bool over = quota_bytes_ > 0 && seen.protected_bytes > quota_bytes_;
  if (over && !over_quota_said_) {
    say("the protected recordings in " + folder_.string() +
        " alone take more than the quota; nothing else is kept for long: end the protection of some");
  }
  over_quota_said_ = over;
  const std::lock_guard lock(mutex_);
  survey_ = seen;
}

void Housekeeper::say(const std::string& sentence) {
  const std::lock_guard lock(mutex_);
  sentences_.push_back(sentence);
}

Survey Housekeeper::survey() const {
  const std::lock_guard lock(mutex_);
  return survey_;
}

std::vector<std::string> Housekeeper::take_sentences() {
  const std::lock_guard lock(mutex_);
  return std::exchange(sentences_, {});
}

core::Result<std::string> Housekeeper::protect(const std::string& name, const std::string& why) {
  const std::lock_guard files(files_mutex_);
  const auto recording = find_recording(folder_, name);
  if (!recording.ok()) return recording.error();
  const auto status = recorder::protect(recording.value(), why);
  if (!status.ok()) return status.error();
  return recording.value().string() + " is protected";
}

core::Result<std::string> Housekeeper::unprotect(const std::string& name) {
  const std::lock_guard files(files_mutex_);
  const auto recording = find_recording(folder_, name);
  if (!recording.ok()) return recording.error();
  const auto status = recorder::unprotect(recording.value());
  if (!status.ok()) return status.error();
  return recording.value().string() + " is not protected any more";
}

}  // namespace railfix::recorder
