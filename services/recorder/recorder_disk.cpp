// What the recorder's thread does about a disk that is full and a file that is removed.
#include "recorder/recorder.hpp"

namespace railfix::recorder {

namespace {

namespace fs = std::filesystem;

constexpr double kRoomAgain = 2;  // times keep_free_mb: enough to record for some time

}  // namespace

bool Recorder::disk_has_less_than(double times, const fs::path& file) const {
  fs::path folder = fs::absolute(file).parent_path();
  std::error_code failed;
  while (!fs::exists(folder, failed) && folder.has_relative_path()) folder = folder.parent_path();
  return static_cast<double>(free_space_(folder)) < times * config_.keep_free_mb * kBytesPerMb;
}

fs::path Recorder::file_on_disk() const {
  return recording_ ? recording_->file() : maker_.folder() / "next";
}

void Recorder::guard_disk() {
  const fs::path file = file_on_disk();
  if (!disk_has_less_than(1, file)) return;
  event_ends_ns_ = 0;
  if (!recording_) return;
  const auto ended = end();
  (void)wait_for_room("recording stopped: ", file);
  if (!ended.ok()) problem_ += "; " + ended.error().message;
}

std::string Recorder::disk_is_full(const fs::path& file) const {
  return "the disk of " + file.string() + " has less than " +
         std::to_string(static_cast<int64_t>(config_.keep_free_mb)) + " MB free";
}

// Of a file that somebody names nothing is done later: by then nobody may want it, and it may be on another disk than
// the one that is looked at.
core::Error Recorder::refuse_without_room(const fs::path& file, bool is_named) {
  const std::string what = "nothing is recorded: ";
  if (is_named) return {what + disk_is_full(file) + "; make room there, or name a file on another disk"};
  return {wait_for_room(what, file)};
}

std::string Recorder::wait_for_room(const std::string& what, const fs::path& file) {
  goes_on_by_itself_ = true;
  problem_ = what + disk_is_full(file) + "; goes on in a new file when " +
             std::to_string(static_cast<int64_t>(kRoomAgain * config_.keep_free_mb)) + " MB are free";
  return problem_;
}

// At once: this has nothing to do with room. When no file can be begun it waits as for a full disk.
void Recorder::leave_removed_file() {
  const std::string file = recording_->file().string();
  (void)end();
  say(file + kActive + " was removed while it was being recorded, and what it held is lost; see who empties the folder",
      true);
  goes_on_by_itself_ = true;
  go_on();
}

void Recorder::go_on_by_itself() {
  if (goes_on_by_itself_ && !disk_has_less_than(kRoomAgain, file_on_disk())) go_on();
}

void Recorder::go_on() {
  if (const auto begun = begin(""); begun.ok()) say("recording goes on in " + begun.value(), false);
}

}  // namespace railfix::recorder
