// The folder of the recordings: names, protection, quota, what a crash left behind.
//
// A recording NAME.mcap is protected while a file NAME.mcap.protected stands beside it; its text says why. So
// protection survives a restart, and a person sees it, makes it (touch) and ends it (rm) without Railfix.
//
// Which recording is the older one does not depend on the clock, which a computer without a battery has wrong at each
// start: each has a number in its metadata `railfix`. Those of before, without one, are older, in the order of their
// time.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "core/result.hpp"

namespace railfix::recorder {

/// As "MB" is meant in the configuration, in recorder_status and in sentences.
inline constexpr uint64_t kBytesPerMb = 1'000'000;

/// Behind the name of a recording that is being written.
inline constexpr const char* kActive = ".active";

/// This recording exists, closed or open. Of a place that cannot be looked at the answer is no: who creates a file
/// there says why.
bool is_taken(const std::filesystem::path& recording);

/// Of a recording's number, in its metadata record `railfix`.
inline constexpr const char* kNumberKey = "number";
/// Above the numbers of all recordings in the folder.
uint64_t next_number(const std::filesystem::path& folder);

/// FOLDER/TRAIN-YYYYMMDD-HHMMSS.mcap for this time (UTC), with a number behind it when that exists. `kind` stands
/// before the ending ("-event").
std::filesystem::path new_name(const std::filesystem::path& folder, const std::string& train_id, int64_t now_ns,
                               const std::string& kind = "");

/// Before the ending of a recording that was made around an event.
inline constexpr const char* kEventKind = "-event";

/// What the folder holds.
struct Survey {
  uint32_t files = 0;  // recordings, with those being written
  uint32_t protected_files = 0;
  uint64_t bytes = 0;
  uint64_t protected_bytes = 0;
  uint64_t event_bytes = 0;                 // of recordings around events
  std::optional<uint64_t> disk_free_bytes;  // for this user; nothing when it cannot be told
};
Survey survey(const std::filesystem::path& folder);

/// The recording that is meant by its name in the folder (with or without its ending) or its path; it may still be
/// being written. Error: there is none, or it is in another folder.
core::Result<std::filesystem::path> find_recording(const std::filesystem::path& folder, const std::string& name);

core::Status protect(const std::filesystem::path& recording, const std::string& why);
core::Status unprotect(const std::filesystem::path& recording);
[[nodiscard]] bool is_protected(const std::filesystem::path& recording);

/// Recordings that a crash left behind (NAME.mcap.active that nobody writes), the newest first. Removes what recoveries
/// left that were cut off themselves. To be asked before a recording is begun, so that none of ours is among them.
std::vector<std::filesystem::path> cut_off_in(const std::filesystem::path& folder);

/// What was recovered takes the place of the cut-off file, and is protected if that was.
void take_place(const std::filesystem::path& cut_off, const std::filesystem::path& recovered);

/// Removes the oldest recordings that are closed, or among those `cut_off`, and not protected until the folder's
/// recordings take no more than this; says which. A recovery's draft does not count: it takes its source's place.
std::vector<std::string> keep_quota(const std::filesystem::path& folder, uint64_t most_bytes,
                                    const std::vector<std::filesystem::path>& cut_off = {});

/// The same until so much of the disk is free, or nothing when it would not be enough; none goes that is newer than
/// this cut-off one.
std::vector<std::string> make_room(const std::filesystem::path& folder, uint64_t bytes,
                                   const std::filesystem::path& for_cut_off);

/// Of the disk, for this user; much when it cannot be told.
uint64_t free_bytes(const std::filesystem::path& folder);

}  // namespace railfix::recorder
