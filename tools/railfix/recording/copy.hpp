// Recordings made of recordings: a part of one, or several as one.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "core/result.hpp"
#include "mcap/losses.hpp"

namespace railfix::tool {

struct CutOptions {
  double from_s = 0;                 // into the recording
  double to_s = 0;                   // exclusive; infinite = to the end
  std::vector<std::string> topics;   // empty = all; "camera_frame" means all its cameras
  std::vector<std::string> without;  // left out
};

struct CopyReport {
  uint64_t samples = 0;
  uint64_t standing = 0;    // cut: values of latched topics from before the part
  uint64_t duplicates = 0;  // merge: samples that stood in more than one recording
  size_t topics = 0;
  mcap::Losses lost;                  // of the recordings that were read
  std::vector<std::string> problems;  // a sentence each
};

/// Latched topics keep the values that held at the beginning. The new file says in its metadata what it is a part of,
/// and what of that could not be read. Error: a topic that the recording does not have.
core::Result<CopyReport> cut_recording(const std::filesystem::path& file, const std::filesystem::path& out,
                                       const CutOptions& options);

/// In the order of the log times. A sample that stands in several of them (same topic, time of sending, count and
/// bytes) is kept once; one that a single recording has twice stays so. What could not be read stands in the metadata.
/// Error: recordings of different trains, whose topics would be taken for one.
core::Result<CopyReport> merge_recordings(const std::vector<std::filesystem::path>& files,
                                          const std::filesystem::path& out);

}  // namespace railfix::tool
