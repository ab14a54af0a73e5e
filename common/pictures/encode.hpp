// Pictures as JPEG or PGM.
#pragma once

#include <cstdint>
#include <vector>

#include "core/result.hpp"

namespace railfix::pictures {

/// 8-bit grey pixels, rows without gaps. Error: the size is not possible.
core::Result<std::vector<uint8_t>> encode_jpeg(const uint8_t* pixels, uint32_t width_px, uint32_t height_px,
                                               int quality);
/// Every pixel as it is, behind a header of at most 20 bytes.
core::Result<std::vector<uint8_t>> encode_pgm(const uint8_t* pixels, uint32_t width_px, uint32_t height_px);

}  // namespace railfix::pictures
