// Pictures that a command draws for the user.
#pragma once

#include <filesystem>
#include <opencv2/core.hpp>

namespace railfix::tool {

/// As core::write_whole(), in the format of the name's ending (.png, .jpg, ...). False also where there is none of it.
[[nodiscard]] bool write_picture(const std::filesystem::path& file, const cv::Mat& picture);

}  // namespace railfix::tool
