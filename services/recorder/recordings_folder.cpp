#include "recorder/recordings_folder.hpp"

#include <algorithm>
#include <array>
#include <ctime>
#include <fstream>

#include "core/time.hpp"
#include "mcap/reader.hpp"

namespace railfix::recorder {

namespace {

namespace fs = std::filesystem;

constexpr const char* kActive = ".active";
constexpr const char* kEnding = ".mcap";
constexpr const char* kRecovered = "-recovered";
constexpr const char* kProtected = ".protected";

struct Found {
  fs::path recording;  // NAME.mcap, also of NAME.mcap.active
  fs::path file;
  fs::file_time_type time;
  uint64_t bytes = 0;
  bool active = false;
};

std::vector<Found> recordings_in(const fs::path& folder) {
  std::vector<Found> all;
  std::error_code failed;
  for (fs::directory_iterator entry(folder, failed); !failed && entry != fs::directory_iterator();
       entry.increment(failed)) {
    // A file may go away while it is looked at.
    std::error_code gone;
    Found found{entry->path(), entry->path(), entry->last_write_time(gone), 0, false};
    if (!gone) found.bytes = entry->file_size(gone);
    found.active = found.recording.extension() == kActive;
    if (found.active) found.recording.replace_extension();
    if (!gone && found.recording.extension() == kEnding) all.push_back(std::move(found));
  }
  return all;
}

fs::path marker_of(const fs::path& recording) {
  return recording.string() + kProtected;
}

}  // namespace

bool is_taken(const fs::path& recording) {
  std::error_code failed;
  return fs::exists(recording, failed) || fs::exists(recording.string() + kActive, failed);
}

fs::path new_name(const fs::path& folder, const std::string& train_id, int64_t now_ns, const std::string& kind) {
  const auto now_s = static_cast<time_t>(now_ns / core::kNsPerSecond);
  tm utc{};
  gmtime_r(&now_s, &utc);
  std::array<char, 32> stamp{};
  (void)std::strftime(stamp.data(), stamp.size(), "%Y%m%d-%H%M%S", &utc);
  std::string train = train_id;
  std::ranges::replace(train, '/', '_');
  const std::string base = train + "-" + stamp.data();
  fs::path file = folder / (base + kind + kEnding);
  for (int i = 2; is_taken(file); ++i) {
    file = folder / (base + "-" + std::to_string(i) + kind + kEnding);
  }
  return file;
}

Survey survey(const fs::path& folder) {
  Survey all;
  for (const Found& found : recordings_in(folder)) {
    ++all.files;
    all.bytes += found.bytes;
    if (found.recording.stem().string().find(kEventKind) != std::string::npos) all.event_bytes += found.bytes;
    if (!is_protected(found.recording)) continue;
    ++all.protected_files;
    all.protected_bytes += found.bytes;
  }
  std::error_code failed;
  const auto space = fs::space(folder, failed);
  if (!failed) all.disk_free_bytes = space.available;
  return all;
}

core::Result<fs::path> find_recording(const fs::path& folder, const std::string& name) {
  if (name.empty()) return core::Error{"say which recording: its name in " + folder.string()};
  const fs::path given(name);
  std::error_code failed;
  if (given.has_parent_path() && !fs::equivalent(given.parent_path(), folder, failed)) {
    return core::Error{name + " is not in the folder of the recordings, " + folder.string()};
  }
  fs::path recording = folder / given.filename();
  if (recording.extension() == kActive) recording.replace_extension();
  if (recording.extension() != kEnding) recording += kEnding;
  if (!is_taken(recording)) return core::Error{"there is no recording " + recording.string()};
  return recording;
}

core::Status protect(const fs::path& recording, const std::string& why) {
  std::ofstream marker(marker_of(recording));
  marker << why << '\n';
  marker.close();
  if (!marker) return core::Error{marker_of(recording).string() + " cannot be written"};
  return {};
}

core::Status unprotect(const fs::path& recording) {
  std::error_code failed;
  if (fs::remove(marker_of(recording), failed)) return {};
  if (failed) return core::Error{marker_of(recording).string() + " cannot be removed (" + failed.message() + ")"};
  return core::Error{recording.string() + " is not protected"};
}

bool is_protected(const fs::path& recording) {
  std::error_code failed;
  return fs::exists(marker_of(recording), failed);
}

std::vector<std::string> recover_folder(const fs::path& folder) {
  std::vector<std::string> sentences;
  std::error_code failed;
  for (const Found& found : recordings_in(folder)) {
    if (!found.active || mcap::being_written(found.file)) continue;
    // A recovery that was itself cut off: its source is still there and is recovered again.
    if (found.recording.stem().string().ends_with(kRecovered)) continue;
    const fs::path name = mcap::recovered_name(found.file);
    const bool kept = is_protected(found.recording);
    if (kept) fs::copy_file(marker_of(found.recording), marker_of(name), fs::copy_options::overwrite_existing, failed);
    const auto lost = mcap::recover(found.file, name);
    if (!lost.ok()) {
      sentences.push_back(found.file.string() +
                          " was left by a crash and cannot be recovered: " + lost.error().message);
      continue;
    }
    fs::remove(found.file, failed);
    if (kept) fs::remove(marker_of(found.recording), failed);
    sentences.push_back(found.file.string() + " was left by a crash; what it held is now in " + name.string());
  }
  return sentences;
}

std::vector<std::string> keep_quota(const fs::path& folder, uint64_t most_bytes) {
  std::vector<Found> all = recordings_in(folder);
  uint64_t sum = 0;
  for (const Found& found : all) sum += found.bytes;
  std::ranges::sort(all, [](const Found& a, const Found& b) {
    return std::tie(a.time, a.recording) < std::tie(b.time, b.recording);
  });
  std::vector<std::string> removed;
  std::error_code failed;
  for (const Found& found : all) {
    if (sum <= most_bytes) break;
    if (found.active || is_protected(found.recording) || !fs::remove(found.file, failed)) continue;
    sum -= found.bytes;
    removed.push_back(found.file.string() + " was removed to keep the quota");
  }
  return removed;
}

}  // namespace railfix::recorder
