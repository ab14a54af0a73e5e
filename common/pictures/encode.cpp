#include "pictures/encode.hpp"

#include <turbojpeg.h>

#include <memory>

namespace railfix::pictures {

core::Result<std::vector<uint8_t>> encode_jpeg(const uint8_t* pixels, uint32_t width_px, uint32_t height_px,
                                               int quality) {
  constexpr uint32_t kLargestJpegPx = 65500;
  if (width_px == 0 || height_px == 0 || width_px > kLargestJpegPx || height_px > kLargestJpegPx) {
    return core::Error{"a picture of " + std::to_string(width_px) + " x " + std::to_string(height_px) +
                       " cannot be a JPEG"};
  }
  const auto width = static_cast<int>(width_px);
  const auto height = static_cast<int>(height_px);
  const std::unique_ptr<void, int (*)(tjhandle)> compressor(tjInitCompress(), &tjDestroy);
  std::vector<uint8_t> jpeg(tjBufSize(width, height, TJSAMP_GRAY));
  unsigned char* bytes = jpeg.data();
  unsigned long size = jpeg.size();
  if (!compressor || tjCompress2(compressor.get(), pixels, width, 0, height, TJPF_GRAY, &bytes, &size, TJSAMP_GRAY,
                                 quality, TJFLAG_NOREALLOC) != 0)
    return core::Error{std::string("a picture cannot be encoded: ") + tjGetErrorStr2(compressor.get())};
  return std::vector<uint8_t>(jpeg.begin(), jpeg.begin() + static_cast<ptrdiff_t>(size));
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

}  // namespace railfix::pictures
