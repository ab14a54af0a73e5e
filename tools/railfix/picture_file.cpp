#include "picture_file.hpp"

#include <opencv2/imgcodecs.hpp>
#include <string>
#include <vector>

#include "core/whole_file.hpp"

namespace railfix::tool {

bool write_picture(const std::filesystem::path& file, const cv::Mat& picture) {
  std::vector<uchar> bytes;
  try {
    if (!cv::imencode(file.extension().string(), picture, bytes)) return false;
  } catch (const cv::Exception&) {
    return false;
  }
  return core::write_whole(file, {bytes.begin(), bytes.end()});
}

}  // namespace railfix::tool
