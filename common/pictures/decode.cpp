#include "pictures/decode.hpp"

#include <turbojpeg.h>

#include <algorithm>
#include <array>
#include <memory>
#include <string>

#include "pictures/formats.hpp"

namespace railfix::pictures {
namespace {

template <size_t N>
bool begins_with(std::span<const uint8_t> file, const std::array<uint8_t, N>& signature) {
  return file.size() >= N && std::equal(signature.begin(), signature.end(), file.begin());
}

/// A warning of the decoder (data that end too early, or make no sense) is an error too: the rest of such a picture is
/// invented, and would be measured in.
core::Status decode_jpeg(std::span<const uint8_t> file, Pixels pixels, const Memory& memory) {
  const std::unique_ptr<void, int (*)(tjhandle)> decompressor(tjInitDecompress(), &tjDestroy);
  if (!decompressor) return core::Error{std::string("cannot be decoded: ") + tjGetErrorStr2(nullptr)};
  int width = 0;
  int height = 0;
  int subsampling = 0;
  int colours = 0;
  if (tjDecompressHeader3(decompressor.get(), file.data(), file.size(), &width, &height, &subsampling, &colours) != 0)
    return broken(tjGetErrorStr2(decompressor.get()));
  if (auto size = check_size(width, height); !size.ok()) return size;
  if (tjDecompress2(decompressor.get(), file.data(), file.size(), memory(width, height), width, 0, height,
                    pixels == Pixels::grey ? TJPF_GRAY : TJPF_BGR, 0) != 0)
    return broken(tjGetErrorStr2(decompressor.get()));
  return {};
}

}  // namespace

core::Error broken(const std::string& why) {
  return core::Error{"is broken: " + why};
}

core::Status check_size(int64_t width_px, int64_t height_px) {
  if (width_px > 0 && height_px > 0 && width_px <= kMostPixels / height_px) return {};
  return broken("it says that it has " + std::to_string(width_px) + "x" + std::to_string(height_px) + " pixels");
}

core::Status decode(std::span<const uint8_t> file, Pixels pixels, const Memory& memory) {
  constexpr std::array<uint8_t, 3> kJpeg = {0xff, 0xd8, 0xff};
  constexpr std::array<uint8_t, 8> kPng = {0x89, 'P', 'N', 'G', '\r', '\n', 0x1a, '\n'};
  if (begins_with(file, kJpeg)) return decode_jpeg(file, pixels, memory);
  if (begins_with(file, kPng)) return decode_png(file, pixels, memory);
  if (begins_with(file, std::array<uint8_t, 2>{'P', '5'})) return decode_pgm(file, pixels, memory);
  return core::Error{file.empty() ? "is empty" : "is neither JPEG, PNG nor PGM"};
}

}  // namespace railfix::pictures
