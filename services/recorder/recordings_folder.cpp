#include "recorder/recordings_folder.hpp"

#include <algorithm>
#include <array>
#include <charconv>
#include <ctime>
#include <fstream>
#include <limits>
#include <optional>
#include <string_view>
#include <tuple>

#include "core/time.hpp"
#include "mcap/reader.hpp"

namespace railfix::recorder {

namespace {

namespace fs = std::filesystem;

constexpr const char* kEnding = ".mcap";
constexpr const char* kRecovered = "-recovered";
constexpr const char* kProtected = ".protected";

struct Found {
  fs::path recording;  // NAME.mcap, also of NAME.mcap.active
  fs::path file;
  fs::file_time_type time;
  uint64_t bytes = 0;
  bool active = false;
  uint64_t number = 0;  // 0: not looked for, or none
};

fs::path recording_of(const fs::path& active) {
  fs::path recording = active;
  return recording.replace_extension();
}

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
    if (found.active) found.recording = recording_of(found.file);
    if (!gone && found.recording.extension() == kEnding) all.push_back(std::move(found));
  }
  return all;
}

/// What a recovery writes, or left when it was cut off itself.
bool is_draft(const Found& found) {
  const std::string stem = found.recording.stem().string();
  if (!found.active || !stem.ends_with(kRecovered)) return false;
  const std::string source = stem.substr(0, stem.size() - std::string_view(kRecovered).size());
  std::error_code failed;
  return fs::exists(found.file.parent_path() / (source + kEnding + kActive), failed);
}

/// Also of what was recovered; a train may have such a name, too.
bool is_of_event(const fs::path& recording) {
  const std::string stem = recording.stem().string();
  return stem.ends_with(kEventKind) || stem.ends_with(std::string(kEventKind) + kRecovered);
}

uint64_t number_of(const fs::path& file) {
  const auto about = mcap::metadata_in_front(file, "railfix");
  if (!about || !about->entries.contains(kNumberKey)) return 0;
  const std::string& text = about->entries.at(kNumberKey);
  uint64_t number = 0;
  (void)std::from_chars(text.data(), text.data() + text.size(), number);
  return number;
}

/// The oldest first.
void sort_by_age(std::vector<Found>& all) {
  for (Found& found : all) found.number = number_of(found.file);
  std::ranges::sort(all, [](const Found& a, const Found& b) {
    return std::tie(a.number, a.time, a.recording) < std::tie(b.number, b.time, b.recording);
  });
}

fs::path marker_of(const fs::path& recording) {
  return recording.string() + kProtected;
}

/// Nothing when it cannot be told.
std::optional<uint64_t> disk_free(const fs::path& folder) {
  std::error_code failed;
  const auto space = fs::space(folder, failed);
  return failed ? std::nullopt : std::optional<uint64_t>(space.available);
}

}  // namespace

bool is_taken(const fs::path& recording) {
  std::error_code failed;
  return fs::exists(recording, failed) || fs::exists(recording.string() + kActive, failed);
}

uint64_t next_number(const fs::path& folder) {
  uint64_t highest = 0;
  for (const Found& found : recordings_in(folder)) highest = std::max(highest, number_of(found.file));
  return highest + 1;
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
    if (is_of_event(found.recording)) all.event_bytes += found.bytes;
    if (!is_protected(found.recording)) continue;
    ++all.protected_files;
    all.protected_bytes += found.bytes;
  }
  all.disk_free_bytes = disk_free(folder);
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

std::vector<fs::path> cut_off_in(const fs::path& folder) {
  std::vector<Found> all = recordings_in(folder);
  sort_by_age(all);
  std::vector<fs::path> files;
  std::error_code failed;
  for (const Found& found : all) {
    if (!found.active || mcap::being_written(found.file)) continue;
    if (is_draft(found)) {
      fs::remove(found.file, failed);
    } else {
      files.insert(files.begin(), found.file);
    }
  }
  return files;
}

void take_place(const fs::path& cut_off, const fs::path& recovered) {
  std::error_code failed;
  const fs::path marker = marker_of(recording_of(cut_off));
  if (fs::exists(marker, failed)) {
    fs::copy_file(marker, marker_of(recovered), fs::copy_options::overwrite_existing, failed);
    if (failed) (void)protect(recovered, "protected before the crash");
  }
  // Its marker last: a crash between the two leaves nothing unprotected.
  if (fs::remove(cut_off, failed)) fs::remove(marker, failed);
}

std::vector<std::string> keep_quota(const fs::path& folder, uint64_t most_bytes, const std::vector<fs::path>& cut_off) {
  std::vector<Found> all = recordings_in(folder);
  std::erase_if(all, is_draft);
  uint64_t sum = 0;
  for (const Found& found : all) sum += found.bytes;
  std::vector<std::string> removed;
  if (sum <= most_bytes) return removed;
  sort_by_age(all);
  std::error_code failed;
  for (const Found& found : all) {
    if (sum <= most_bytes) break;
    const bool open = found.active && std::ranges::find(cut_off, found.file) == cut_off.end();
    if (open || is_protected(found.recording) || !fs::remove(found.file, failed)) continue;
    sum -= found.bytes;
    removed.push_back(found.file.string() + (found.active ? ", which a crash left and which was not recovered," : "") +
                      " was removed to keep the quota");
  }
  return removed;
}

std::vector<std::string> make_room(const fs::path& folder, uint64_t bytes, const fs::path& for_cut_off) {
  std::vector<Found> older = recordings_in(folder);
  sort_by_age(older);
  older.erase(std::ranges::find(older, for_cut_off, &Found::file), older.end());
  std::erase_if(older, [](const Found& found) { return found.active || is_protected(found.recording); });
  uint64_t room = free_bytes(folder);
  for (const Found& found : older) room += std::min(found.bytes, bytes);
  std::vector<std::string> removed;
  if (room < bytes) return removed;
  std::error_code failed;
  for (const Found& found : older) {
    if (free_bytes(folder) >= bytes) break;
    if (!fs::remove(found.file, failed)) continue;
    removed.push_back(found.file.string() + " was removed to make room for recovering " + for_cut_off.string());
  }
  return removed;
}

uint64_t free_bytes(const fs::path& folder) {
  return disk_free(folder).value_or(std::numeric_limits<uint64_t>::max() / 2);
}

}  // namespace railfix::recorder
