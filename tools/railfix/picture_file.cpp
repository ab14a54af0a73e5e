#include "picture_file.hpp"

#include <opencv2/imgcodecs.hpp>
#include <string>
#include <vector>

#include "core/whole_file.hpp"

namespace railfix::tool {

core::Status write_picture(const std::filesystem::path& file, const cv::Mat& picture) {
  std::vector<uchar> bytes;
  bool known = false;
  try {
    known = cv::imencode(file.extension().string(), picture, bytes);
  } catch (const cv::Exception&) {
  }
  if (!known) return core::Error{"cannot write " + file.string() + " as a picture; end its name in .png"};
  return core::write_whole(file, {bytes.begin(), bytes.end()});
}

}  // namespace railfix::tool
