// Pictures of files and messages as pixels: JPEG, PNG and PGM, whatever their name says.
#pragma once

#include <cstdint>
#include <functional>
#include <span>

#include "core/result.hpp"

namespace railfix::pictures {

/// Grey: one byte a pixel; colours become luma, 16 bits lose their lower eight. Colour: blue, green, red.
enum class Pixels : uint8_t { grey, bgr };

/// Gives the memory for the pixels, rows without gaps: width * height bytes, or three times as many.
using Memory = std::function<uint8_t*(int width_px, int height_px)>;

/// The error is a part of a sentence: "is broken: Premature end of JPEG file". What a picture says of its orientation
/// is not obeyed: the calibration is for the pixels as the camera gave them.
core::Status decode(std::span<const uint8_t> file, Pixels pixels, const Memory& memory);

}  // namespace railfix::pictures
