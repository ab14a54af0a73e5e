#include "frame_grabber/raw_picture.hpp"

#include <cstring>
#include <opencv2/imgproc.hpp>

#include "core/joined.hpp"

namespace railfix::frame_grabber {
namespace {

constexpr std::pair<const char*, PixelFormat> kNames[] = {{"Mono8", PixelFormat::mono8},
                                                          {"Mono12p", PixelFormat::mono12p},
                                                          {"Mono12Packed", PixelFormat::mono12_packed},
                                                          {"Mono16", PixelFormat::mono16},
                                                          {"BayerRG8", PixelFormat::bayer_rg8},
                                                          {"BayerGR8", PixelFormat::bayer_gr8},
                                                          {"BayerGB8", PixelFormat::bayer_gb8},
                                                          {"BayerBG8", PixelFormat::bayer_bg8},
                                                          {"BGR8", PixelFormat::bgr8}};

/// OpenCV names a Bayer pattern after its second row's second and third pixel: GenICam's RG is OpenCV's BG.
int bayer_code(PixelFormat format) {
  switch (format) {
    case PixelFormat::bayer_rg8:
      return cv::COLOR_BayerBG2GRAY;
    case PixelFormat::bayer_gr8:
      return cv::COLOR_BayerGB2GRAY;
    case PixelFormat::bayer_gb8:
      return cv::COLOR_BayerGR2GRAY;
    default:
      return cv::COLOR_BayerRG2GRAY;
  }
}

/// Bytes of two pixels a and b: mono12p aaaaaaaa bbbbaaaa bbbbbbbb from the lowest bit, packed aaaaaaaa(high) ..
/// b(high).
void unpack_12(const uint8_t* from, uint8_t* to, int pixels, bool packed) {
  int i = 0;
  for (; i + 1 < pixels; i += 2, from += 3) {
    to[i] = packed ? from[0] : static_cast<uint8_t>((from[0] >> 4) | (from[1] << 4));
    to[i + 1] = from[2];
  }
  if (i < pixels) to[i] = packed ? from[0] : static_cast<uint8_t>((from[0] >> 4) | (from[1] << 4));
}

void row_to_mono8(PixelFormat format, const uint8_t* from, uint8_t* to, int width) {
  if (format == PixelFormat::mono8) {
    std::memcpy(to, from, static_cast<size_t>(width));
  } else if (format == PixelFormat::mono16) {
    for (int i = 0; i < width; ++i) to[i] = from[2 * i + 1];  // little endian
  } else {
    unpack_12(from, to, width, format == PixelFormat::mono12_packed);
  }
}

cv::Mat view(const RawPicture& picture, int type) {
  // Only read; cv::Mat has no constant view of foreign memory.
  auto* bytes = const_cast<uint8_t*>(picture.bytes);  // NOLINT(cppcoreguidelines-pro-type-const-cast)
  return {picture.size, type, bytes, picture.row_bytes};
}

}  // namespace

std::optional<PixelFormat> pixel_format(const std::string& genicam_name) {
  for (const auto& [name, format] : kNames) {
    if (genicam_name == name) return format;
  }
  return std::nullopt;
}

std::string pixel_format_names() {
  return core::joined(kNames, [](const auto& known) { return known.first; });
}

size_t bytes_of_row(PixelFormat format, int width_px) {
  const auto width = static_cast<size_t>(width_px);
  switch (format) {
    case PixelFormat::mono12p:
    case PixelFormat::mono12_packed:
      return (width * 3 + 1) / 2;
    case PixelFormat::mono16:
      return width * 2;
    case PixelFormat::bgr8:
      return width * 3;
    default:
      return width;
  }
}

RawPicture raw_of(int64_t stamp_ns, const cv::Mat& grey) {
  RawPicture picture;
  picture.stamp_ns = stamp_ns;
  picture.size = grey.size();
  picture.bytes = grey.data;
  picture.row_bytes = grey.step;
  picture.keep = std::make_shared<cv::Mat>(grey);
  return picture;
}

void to_mono8(const RawPicture& picture, uint8_t* grey) {
  cv::Mat target(picture.size, CV_8UC1, grey);
  switch (picture.format) {
    case PixelFormat::bgr8:
      return cv::cvtColor(view(picture, CV_8UC3), target, cv::COLOR_BGR2GRAY);
    case PixelFormat::bayer_rg8:
    case PixelFormat::bayer_gr8:
    case PixelFormat::bayer_gb8:
    case PixelFormat::bayer_bg8:
      return cv::cvtColor(view(picture, CV_8UC1), target, bayer_code(picture.format));
    default:
      for (int row = 0; row < picture.size.height; ++row) {
        row_to_mono8(picture.format, picture.bytes + static_cast<size_t>(row) * picture.row_bytes, target.ptr(row),
                     picture.size.width);
      }
  }
}

}  // namespace railfix::frame_grabber
