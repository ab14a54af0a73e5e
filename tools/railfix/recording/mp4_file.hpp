// Whether a film is all there: OpenCV tells nobody when a film cannot be written.
#pragma once

#include <filesystem>

#include "core/result.hpp"

namespace railfix::tool {

/// Whether the film could grow: what stops FFmpeg stops us, too, and gives us the reason. Writes behind its end; an
/// error calls it `name`.
core::Status takes_more(const std::filesystem::path& film, const std::string& name);

/// Looks at the boxes of an MP4 file: FFmpeg writes the index last, and says only then how long the pictures are.
/// Error: as above.
core::Status whole_mp4(const std::filesystem::path& film, const std::string& name);

}  // namespace railfix::tool
