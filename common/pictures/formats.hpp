// The formats that decode() tells apart.
#pragma once

#include "pictures/decode.hpp"

namespace railfix::pictures {

/// More is no picture of a camera, but a broken head.
constexpr int64_t kMostPixels = 1 << 28;

core::Error broken(const std::string& why);
/// Nothing, or why there is no memory for this.
core::Status check_size(int64_t width_px, int64_t height_px);

core::Status decode_png(std::span<const uint8_t> file, Pixels pixels, const Memory& memory);
core::Status decode_pgm(std::span<const uint8_t> file, Pixels pixels, const Memory& memory);

}  // namespace railfix::pictures
