// PNG with libpng, row by row as its manual says.
#include <png.h>

#include <algorithm>
#include <csetjmp>
#include <string>
#include <vector>

#include "pictures/formats.hpp"

namespace railfix::pictures {
namespace {

/// What libpng's calls share; they leave by longjmp, which runs no destructors, so nothing is made while they run.
struct Reading {
  std::span<const uint8_t> left;
  std::string problem;
  std::vector<png_bytep> rows;
};

void read(png_structp png, png_bytep to, size_t bytes) {
  auto& left = static_cast<Reading*>(png_get_io_ptr(png))->left;
  if (left.size() < bytes) png_error(png, "it ends too early");
  std::copy_n(left.begin(), bytes, to);
  left = left.subspan(bytes);
}

[[noreturn]] void fail(png_structp png, png_const_charp why) {
  static_cast<Reading*>(png_get_error_ptr(png))->problem = why;
  png_longjmp(png, 1);
}

void ignore(png_structp /*png*/, png_const_charp /*why*/) {}

class Decoder {
 public:
  explicit Decoder(std::span<const uint8_t> file)
      : reading_{file, {}, {}},
        png_(png_create_read_struct(PNG_LIBPNG_VER_STRING, &reading_, fail, ignore)),
        info_(png_ != nullptr ? png_create_info_struct(png_) : nullptr) {}
  ~Decoder() { png_destroy_read_struct(&png_, &info_, nullptr); }
  Decoder(const Decoder&) = delete;
  Decoder& operator=(const Decoder&) = delete;

  core::Status run(Pixels pixels, const Memory& memory) {
    if (info_ == nullptr) return core::Error{"cannot be decoded: there is no memory"};
    if (!head(pixels)) return broken(reading_.problem);
    const auto width = static_cast<int>(png_get_image_width(png_, info_));
    const auto height = static_cast<int>(png_get_image_height(png_, info_));
    if (auto size = check_size(width, height); !size.ok()) return size;
    const size_t row_bytes = static_cast<size_t>(width) * (pixels == Pixels::grey ? 1 : 3);
    if (png_get_rowbytes(png_, info_) != row_bytes) return broken("its rows have another length than it says");
    uint8_t* const to = memory(width, height);
    for (int row = 0; row < height; ++row) reading_.rows.push_back(to + static_cast<size_t>(row) * row_bytes);
    if (!body()) return broken(reading_.problem);
    return {};
  }

 private:
  bool head(Pixels pixels) {
    if (setjmp(png_jmpbuf(png_)) != 0) return false;  // NOLINT(cert-err52-cpp)
    png_set_read_fn(png_, &reading_, read);
    png_read_info(png_, info_);
    const auto colours = png_get_color_type(png_, info_);
    png_set_strip_16(png_);
    png_set_strip_alpha(png_);
    if (colours == PNG_COLOR_TYPE_PALETTE) png_set_palette_to_rgb(png_);
    if (colours == PNG_COLOR_TYPE_GRAY) png_set_expand_gray_1_2_4_to_8(png_);
    if (pixels == Pixels::grey) {
      constexpr int kSilently = 1;
      constexpr double kRed = 0.299;  // of luma, ITU-R BT.601
      constexpr double kGreen = 0.587;
      png_set_rgb_to_gray(png_, kSilently, kRed, kGreen);
    } else {
      png_set_gray_to_rgb(png_);
      png_set_bgr(png_);
    }
    png_set_interlace_handling(png_);
    png_read_update_info(png_, info_);
    return true;
  }
  bool body() {
    if (setjmp(png_jmpbuf(png_)) != 0) return false;  // NOLINT(cert-err52-cpp)
    png_read_image(png_, reading_.rows.data());
    png_read_end(png_, nullptr);
    return true;
  }

  Reading reading_;
  png_structp png_;
  png_infop info_;
};

}  // namespace

core::Status decode_png(std::span<const uint8_t> file, Pixels pixels, const Memory& memory) {
  return Decoder(file).run(pixels, memory);
}

}  // namespace railfix::pictures
