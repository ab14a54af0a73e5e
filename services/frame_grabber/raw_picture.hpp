// A picture as a camera or a file gives it, and how it becomes mono8.
#pragma once

#include <cstdint>
#include <memory>
#include <opencv2/core.hpp>
#include <optional>
#include <string>

namespace railfix::frame_grabber {

/// Names as in the GenICam pixel format naming convention. mono12p and mono12_packed hold two pixels in three bytes.
enum class PixelFormat : uint8_t {
  mono8,
  mono12p,
  mono12_packed,
  mono16,
  bayer_rg8,
  bayer_gr8,
  bayer_gb8,
  bayer_bg8,
  bgr8
};

/// Nothing when it is a format that is not read.
std::optional<PixelFormat> pixel_format(const std::string& genicam_name);
/// "Mono8, Mono12p, ..."
std::string pixel_format_names();
/// Bytes of a row without gaps.
size_t bytes_of_row(PixelFormat format, int width_px);

struct RawPicture {
  int64_t stamp_ns = 0;       // mid-exposure, Unix epoch
  float exposure_s = 0;       // 0 = not known
  uint64_t lost = 0;          // pictures of the camera that never came, since the last one
  uint64_t bad_packets = 0;   // network packets that never came, since the camera was connected
  bool no_host_time = false;  // its stamp should be the camera's by PTP, but is that of its arrival
  cv::Size size;
  PixelFormat format = PixelFormat::mono8;
  const uint8_t* bytes = nullptr;
  size_t row_bytes = 0;
  std::shared_ptr<const void> keep;  // as long as this is kept, `bytes` may be read
};

/// A picture in mono8 that is kept as long as the raw picture.
RawPicture raw_of(int64_t stamp_ns, const cv::Mat& grey);

/// Writes size.area() bytes, rows without gaps: the only time that the picture is copied on its way to the topic.
/// 12 and 16 bits lose their lowest; colours become luma.
void to_mono8(const RawPicture& picture, uint8_t* grey);

}  // namespace railfix::frame_grabber
