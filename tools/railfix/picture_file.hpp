// Pictures that a command draws for the user.
#pragma once

#include <filesystem>
#include <opencv2/core.hpp>

#include "core/result.hpp"

namespace railfix::tool {

/// As core::write_whole(), in the format of the name's ending (.png, .jpg, ...). Error also where there is none of it.
core::Status write_picture(const std::filesystem::path& file, const cv::Mat& picture);

}  // namespace railfix::tool
