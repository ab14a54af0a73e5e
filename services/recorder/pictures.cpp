#include "recorder/pictures.hpp"

#include <opencv2/imgcodecs.hpp>

namespace railfix::recorder {

core::Result<std::vector<uint8_t>> encode_jpeg(const uint8_t* pixels, uint32_t width_px, uint32_t height_px,
                                               int quality) {
  constexpr uint32_t kLargestJpegPx = 65500;
  if (width_px == 0 || height_px == 0 || width_px > kLargestJpegPx || height_px > kLargestJpegPx) {
    return core::Error{"a picture of " + std::to_string(width_px) + " x " + std::to_string(height_px) +
                       " cannot be a JPEG"};
  }
  // OpenCV has no view of constant memory; imencode only reads.
  const cv::Mat picture(static_cast<int>(height_px), static_cast<int>(width_px), CV_8UC1, const_cast<uint8_t*>(pixels));
  std::vector<uint8_t> jpeg;
  try {
    if (cv::imencode(".jpg", picture, jpeg, {cv::IMWRITE_JPEG_QUALITY, quality})) return jpeg;
  } catch (const cv::Exception& error) {
    return core::Error{"a picture cannot be encoded: " + error.err};
  }
  return core::Error{"a picture cannot be encoded"};
}

core::Result<std::vector<uint8_t>> encode_pgm(const uint8_t* pixels, uint32_t width_px, uint32_t height_px) {
  if (width_px == 0 || height_px == 0) return core::Error{"a picture without pixels"};
  const std::string head = "P5\n" + std::to_string(width_px) + " " + std::to_string(height_px) + "\n255\n";
  std::vector<uint8_t> pgm;
  pgm.reserve(head.size() + static_cast<size_t>(width_px) * height_px);
  pgm.insert(pgm.end(), head.begin(), head.end());
  pgm.insert(pgm.end(), pixels, pixels + static_cast<size_t>(width_px) * height_px);
  return pgm;
}

core::Result<cv::Mat> decode_picture(const std::vector<uint8_t>& bytes) {
  try {
    cv::Mat picture = cv::imdecode(bytes, cv::IMREAD_GRAYSCALE);
    if (!picture.empty()) return picture;
  } catch (const cv::Exception&) {
    return core::Error{"a recorded picture is neither JPEG nor PGM"};
  }
  return core::Error{"a recorded picture is neither JPEG nor PGM"};
}

}  // namespace railfix::recorder
