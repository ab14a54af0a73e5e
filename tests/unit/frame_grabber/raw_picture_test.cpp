#include "frame_grabber/raw_picture.hpp"

#include <gtest/gtest.h>

#include <opencv2/imgproc.hpp>
#include <vector>

namespace railfix::frame_grabber {
namespace {

std::vector<uint8_t> mono8(PixelFormat format, cv::Size size, const std::vector<uint8_t>& bytes) {
  RawPicture picture;
  picture.size = size;
  picture.format = format;
  picture.bytes = bytes.data();
  picture.row_bytes = bytes_of_row(format, size.width);
  EXPECT_EQ(bytes.size(), picture.row_bytes * static_cast<size_t>(size.height));
  std::vector<uint8_t> grey(static_cast<size_t>(size.area()));
  to_mono8(picture, grey.data());
  return grey;
}

using Bytes = std::vector<uint8_t>;

// The pixels 0xABC and 0xDEF, and 0x123 alone in an odd row.
TEST(RawPicture, TwelveBitsLoseTheirLowestFour) {
  EXPECT_EQ(mono8(PixelFormat::mono12p, {2, 1}, {0xBC, 0xFA, 0xDE}), (Bytes{0xAB, 0xDE}));
  EXPECT_EQ(mono8(PixelFormat::mono12_packed, {2, 1}, {0xAB, 0xFC, 0xDE}), (Bytes{0xAB, 0xDE}));
  EXPECT_EQ(mono8(PixelFormat::mono12p, {3, 1}, {0xBC, 0xFA, 0xDE, 0x23, 0x01}), (Bytes{0xAB, 0xDE, 0x12}));
}

TEST(RawPicture, SixteenBitsAndRowsWithGaps) {
  EXPECT_EQ(mono8(PixelFormat::mono16, {2, 1}, {0x34, 0x12, 0xFF, 0x80}), (Bytes{0x12, 0x80}));
  const cv::Mat wide(3, 10, CV_8UC1, cv::Scalar(7));
  const cv::Mat part = wide.colRange(2, 6);
  Bytes grey(12);
  to_mono8(raw_of(1, part), grey.data());
  EXPECT_EQ(grey, Bytes(12, 7));
}

// A red surface: only the red pixels of the pattern are lit, and luma is 0.299 of it.
TEST(RawPicture, BayerPatternsAreNamedAfterTheirFirstPixels) {
  const std::pair<PixelFormat, cv::Point> patterns[] = {{PixelFormat::bayer_rg8, {0, 0}},
                                                        {PixelFormat::bayer_gr8, {1, 0}},
                                                        {PixelFormat::bayer_gb8, {0, 1}},
                                                        {PixelFormat::bayer_bg8, {1, 1}}};
  for (const auto& [format, red] : patterns) {
    Bytes bytes(64, 0);
    for (int y = red.y; y < 8; y += 2) {
      for (int x = red.x; x < 8; x += 2) bytes[static_cast<size_t>(8 * y + x)] = 200;
    }
    const auto grey = mono8(format, {8, 8}, bytes);
    EXPECT_NEAR(grey[8 * 3 + 3], 60, 2) << static_cast<int>(format);
    EXPECT_NEAR(grey[8 * 4 + 4], 60, 2) << static_cast<int>(format);
  }
}

TEST(RawPicture, NamesOfFormats) {
  EXPECT_EQ(pixel_format("Mono12p"), PixelFormat::mono12p);
  EXPECT_FALSE(pixel_format("YUV422"));
}

}  // namespace
}  // namespace railfix::frame_grabber
