#include "pictures/encode.hpp"

#include <gtest/gtest.h>

#include <opencv2/imgcodecs.hpp>

namespace railfix::pictures {
namespace {

TEST(Encode, PgmKeepsEveryPixel) {
  std::vector<uint8_t> pixels(63 * 48);
  for (size_t i = 0; i < pixels.size(); ++i) pixels[i] = static_cast<uint8_t>(i * i);
  const auto pgm = encode_pgm(pixels.data(), 63, 48);
  ASSERT_TRUE(pgm.ok());
  const cv::Mat back = cv::imdecode(pgm.value(), cv::IMREAD_GRAYSCALE);
  ASSERT_EQ(back.size(), cv::Size(63, 48));
  EXPECT_TRUE(std::equal(pixels.begin(), pixels.end(), back.data));
  EXPECT_FALSE(encode_pgm(pixels.data(), 0, 48).ok());
}

TEST(Encode, JpegKeepsThePicture) {
  std::vector<uint8_t> pixels(64 * 48);
  for (size_t i = 0; i < pixels.size(); ++i) pixels[i] = static_cast<uint8_t>(i % 64 * 3);
  const auto jpeg = encode_jpeg(pixels.data(), 64, 48, 90);
  ASSERT_TRUE(jpeg.ok());
  const cv::Mat back = cv::imdecode(jpeg.value(), cv::IMREAD_UNCHANGED);
  ASSERT_EQ(back.type(), CV_8UC1) << "grey, not three colours";
  ASSERT_EQ(back.size(), cv::Size(64, 48));
  for (size_t i = 0; i < pixels.size(); ++i) EXPECT_NEAR(back.data[i], pixels[i], 6);
  EXPECT_FALSE(encode_jpeg(pixels.data(), 0, 48, 90).ok());
  EXPECT_FALSE(encode_jpeg(pixels.data(), 65501, 48, 90).ok());
}

}  // namespace
}  // namespace railfix::pictures
