#include "recorder/housekeeper.hpp"

#include <sys/resource.h>

#include <algorithm>
#include <utility>

#include "core/time.hpp"
#include "mcap/reader.hpp"

namespace railfix::recorder {

namespace {

namespace fs = std::filesystem;

constexpr std::chrono::seconds kPeriod{2};
// The disk fills faster while a file is recovered.
constexpr int64_t kPeriodRecoveringNs = core::kNsPerSecond / 4;
// Times keep_free_mb, at which recording would stop: recording goes on while a file is recovered.
constexpr uint64_t kRoomToBegin = 2;
constexpr double kRoomToGoOn = 1.5;
// The train's other work comes first.
constexpr int kNice = 10;

std::string mb_text(uint64_t bytes) {
  return std::to_string(bytes / kBytesPerMb + 1) + " MB";
}

/// Whether there is more in the cut-off file than an empty recording holds, though no sample that our reader finds.
bool nothing_came_of(const fs::path& cut_off, const fs::path& recovered) {
  const auto reader = mcap::Reader::open(recovered);
  std::error_code failed;
  return reader.ok() && reader.value()->statistics().messages == 0 &&
         fs::file_size(cut_off, failed) > fs::file_size(recovered, failed);
}

}  // namespace

Housekeeper::Housekeeper(fs::path folder, const FolderRules& rules) : folder_(std::move(folder)), rules_(rules) {
  if (rules_.recovers) {
    for (const auto& file : cut_off_in(folder_)) cut_off_.push_back({file});
  }
  thread_ = std::thread([this] { run(); });
}

Housekeeper::~Housekeeper() {
  {
    const std::lock_guard lock(mutex_);
    ending_ = true;
  }
  woken_.notify_all();
  thread_.join();
}

void Housekeeper::run() {
  (void)setpriority(PRIO_PROCESS, 0, kNice);  // of this thread
  while (!ending_) {
    try {
      look();
      if (recovers_) recover_next();
    } catch (const std::exception& error) {
      warn(folder_.string() + " cannot be looked after: " + error.what());
    }
    std::unique_lock lock(mutex_);
    recovering_.clear();
    woken_.wait_for(lock, kPeriod, [this] { return ending_ || (recovers_ && next_to_recover() != cut_off_.end()); });
  }
}

void Housekeeper::look() {
  looked_ns_ = core::monotonic_ns();
  Survey seen;
  {
    const std::lock_guard files(files_mutex_);
    if (rules_.quota_bytes > 0) {
      std::vector<fs::path> removable;
      for (const CutOff& one : cut_off_) removable.push_back(one.file);
      for (const auto& sentence : keep_quota(folder_, rules_.quota_bytes, removable)) say(sentence);
    }
    seen = recorder::survey(folder_);
  }
  const bool over = rules_.quota_bytes > 0 && seen.protected_bytes > rules_.quota_bytes;
  if (over && !over_quota_said_) {
    say("the protected recordings in " + folder_.string() +
        " alone take more than the quota; nothing else is kept for long: end the protection of some");
  }
  over_quota_said_ = over;
  const std::lock_guard lock(mutex_);
  survey_ = seen;
}

void Housekeeper::recover() {
  {
    const std::lock_guard lock(mutex_);
    recovers_ = true;
  }
  woken_.notify_all();
}

std::vector<Housekeeper::CutOff>::iterator Housekeeper::next_to_recover() {
  return std::ranges::find_if(cut_off_, [this](const CutOff& one) {
    return one.state == CutOff::State::new_to_us ||
           (one.state == CutOff::State::without_room && free_bytes(folder_) >= room_for(one.file));
  });
}

void Housekeeper::recover_next() {
  const auto next = next_to_recover();
  if (next == cut_off_.end()) return;
  const auto [file, state] = *next;
  cut_off_.erase(next);
  std::error_code failed;
  // Somebody may have taken it away meanwhile, or be repairing it.
  if (!fs::exists(file, failed) || mcap::being_written(mcap::recovered_name(file).string() + kActive)) return;
  if (state == CutOff::State::new_to_us && !makes_room_for(file)) {
    cut_off_.push_back({file, CutOff::State::without_room});
    return;
  }
  {
    const std::lock_guard lock(mutex_);
    recovering_ = file.string();
  }
  const fs::path name = mcap::recovered_name(file);
  disk_filled_ = false;
  auto lost = mcap::recover(file, name, [this] { return goes_on(); });
  if (lost.ok() && nothing_came_of(file, name)) {
    fs::remove(name, failed);
    lost = core::Error{"no sample of it can be read"};
  }
  if (lost.ok()) {
    const std::lock_guard files(files_mutex_);
    take_place(file, name);
    std::string sentence = file.string() + " was left by a crash; what it held is now in " + name.string();
    for (const auto& what : lost.value()) sentence += "; " + what;
    warn(sentence);
  } else if (!ending_) {
    cut_off_.push_back({file, recovery_ended(file, lost.error())});
  }
}

Housekeeper::CutOff::State Housekeeper::recovery_ended(const fs::path& file, const core::Error& why) {
  const std::string what = file.string() + " was left by a crash, cannot be recovered now and stays as it is: ";
  if (!disk_filled_) {
    warn(what + why.message);
    return CutOff::State::beyond_recovery;
  }
  warn(what + "the disk has become too full meanwhile; it is tried again when " + mb_text(room_for(file)) +
       " of it are free");
  return CutOff::State::without_room;
}

uint64_t Housekeeper::room_for(const fs::path& cut_off) const {
  std::error_code failed;
  const uint64_t bytes = fs::file_size(cut_off, failed);
  return failed ? 0 : bytes + kRoomToBegin * rules_.keep_free_bytes;  // recovering it says why
}

bool Housekeeper::makes_room_for(const fs::path& cut_off) {
  const uint64_t need = room_for(cut_off);
  if (rules_.quota_bytes > 0) {
    const std::lock_guard files(files_mutex_);
    for (const auto& sentence : make_room(folder_, need, cut_off)) warn(sentence);
  }
  if (free_bytes(folder_) >= need) return true;
  warn(cut_off.string() + " was left by a crash and stays as it is until " + mb_text(need) +
       " of the disk are free to recover it");
  return false;
}

bool Housekeeper::goes_on() {
  if (core::monotonic_ns() - looked_ns_ < kPeriodRecoveringNs) return !ending_;
  look();
  const auto least = static_cast<uint64_t>(kRoomToGoOn * static_cast<double>(rules_.keep_free_bytes));
  disk_filled_ = free_bytes(folder_) < least;
  return !ending_ && !disk_filled_;
}

void Housekeeper::say(const std::string& sentence) {
  const std::lock_guard lock(mutex_);
  sentences_.push_back(sentence);
}

void Housekeeper::warn(const std::string& sentence) {
  const std::lock_guard lock(mutex_);
  warnings_.push_back(sentence);
}

std::string Housekeeper::recovering() const {
  const std::lock_guard lock(mutex_);
  return recovering_;
}

std::vector<std::string> Housekeeper::take_warnings() {
  const std::lock_guard lock(mutex_);
  return std::exchange(warnings_, {});
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
