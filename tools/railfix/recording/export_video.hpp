// The pictures of a recording as a film, with the rails and the train's place drawn in.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "core/result.hpp"
#include "mcap/reader.hpp"

namespace railfix::tool {

struct VideoOptions {
  std::string camera;  // empty = the first one that has pictures
  double fps = 0;      // 0 = as the pictures come
};

struct VideoReport {
  uint64_t frames = 0;
  uint64_t pictures = 0;
  uint64_t with_rails = 0;  // both rails drawn
  double fps = 0;
  std::string codec;
  std::vector<std::string> problems;  // a sentence each
};

/// H.264 where OpenCV's FFmpeg has it, else MPEG-4. Runs as fast as the train did: a picture stands until the next one
/// was taken. Takes the file's place when it is whole, as MP4 whatever the name. Error: no pictures, or the file cannot
/// be written; an older one is then as it was.
core::Result<VideoReport> export_video(mcap::Reader& reader, const mcap::Selection& part, const VideoOptions& options,
                                       const std::filesystem::path& file);

}  // namespace railfix::tool
