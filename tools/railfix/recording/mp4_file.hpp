// Whether a film is all there: OpenCV tells nobody when a film cannot be written.
#pragma once

#include <filesystem>

#include "core/result.hpp"

namespace railfix::tool {

/// Looks at the boxes of an MP4 file: FFmpeg writes the index last, and says only then how long the pictures are.
/// Error: the reason, for which it writes behind the film's end; it calls the film `name`.
core::Status whole_mp4(const std::filesystem::path& film, const std::string& name);

}  // namespace railfix::tool
