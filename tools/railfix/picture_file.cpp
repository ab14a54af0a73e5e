#include "picture_file.hpp"

#include <opencv2/imgcodecs.hpp>
#include <string>
#include <vector>

#include "core/whole_file.hpp"

namespace railfix::tool {

core::Status write_picture(const std::filesystem::path& file, const cv::Mat& picture) {
  std::vector<uchar> bytes;
  if (!cv::haveImageWriter(file.string()))
    return core::Error{"cannot write " + file.string() + " as a picture; end its name in .png"};
  try {
    cv::imencode(file.extension().string(), picture, bytes);
  } catch (const cv::Exception& error) {
    return core::Error{"cannot write " + file.string() + " as a picture (" + error.err + ")"};
  }
  return core::write_whole(file, {bytes.begin(), bytes.end()});
}

}  // namespace railfix::tool
