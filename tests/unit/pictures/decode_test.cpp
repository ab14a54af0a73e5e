// OpenCV's own reader is the reference: a dataset gives the same pixels as it always did.
#include "pictures/decode.hpp"

#include <gmock/gmock.h>

#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <random>

namespace railfix::pictures {
namespace {

using ::testing::HasSubstr;
using Bytes = std::vector<uint8_t>;

struct Decoded {
  cv::Mat picture;
  core::Status status;
};
Decoded decoded(const Bytes& file, Pixels pixels) {
  Decoded made;
  made.status = decode(file, pixels, [&](int width_px, int height_px) {
    made.picture.create(height_px, width_px, pixels == Pixels::grey ? CV_8UC1 : CV_8UC3);
    return made.picture.data;
  });
  return made;
}
std::string problem(const Bytes& file) {
  const auto made = decoded(file, Pixels::grey);
  return made.status.ok() ? "none" : made.status.error().message;
}

/// Edges, noise and colours; an odd size, so that rows have rests.
cv::Mat scene(int type) {
  cv::Mat picture(67, 93, CV_8UC3);
  cv::RNG random(7);
  random.fill(picture, cv::RNG::UNIFORM, 0, 255);
  cv::GaussianBlur(picture, picture, {}, 1.2);
  cv::line(picture, {5, 60}, {80, 3}, {20, 240, 60}, 3);
  if (type == CV_8UC3) return picture;
  cv::Mat other;
  cv::cvtColor(picture, other, type == CV_8UC4 ? cv::COLOR_BGR2BGRA : cv::COLOR_BGR2GRAY);
  if (type == CV_16UC1) other.convertTo(other, CV_16U, 257, 3);
  return other;
}
Bytes encoded(const std::string& extension, const cv::Mat& picture, const std::vector<int>& how = {}) {
  Bytes bytes;
  cv::imencode(extension, picture, bytes, how);
  return bytes;
}
void expect_as_opencv(const Bytes& file, const std::string& what) {
  for (const auto& [pixels, flag] : {std::pair{Pixels::grey, cv::IMREAD_GRAYSCALE}, {Pixels::bgr, cv::IMREAD_COLOR}}) {
    const auto made = decoded(file, pixels);
    ASSERT_TRUE(made.status.ok()) << what << ": " << made.status.error().message;
    const cv::Mat reference = cv::imdecode(file, flag | cv::IMREAD_IGNORE_ORIENTATION);
    ASSERT_EQ(made.picture.size(), reference.size()) << what;
    EXPECT_EQ(cv::norm(made.picture, reference, cv::NORM_INF), 0)
        << what << (pixels == Pixels::grey ? " grey" : " bgr");
  }
}

TEST(Decode, PixelsAreThoseOfOpencv) {
  for (const int type : {CV_8UC1, CV_8UC3}) {
    expect_as_opencv(encoded(".jpg", scene(type)), "jpeg");
    expect_as_opencv(encoded(".jpg", scene(type), {cv::IMWRITE_JPEG_PROGRESSIVE, 1}), "progressive jpeg");
  }
  for (const int type : {CV_8UC1, CV_8UC3, CV_8UC4, CV_16UC1}) expect_as_opencv(encoded(".png", scene(type)), "png");
  expect_as_opencv(encoded(".png", scene(CV_8UC1) > 100, {cv::IMWRITE_PNG_BILEVEL, 1}), "png of one bit");
  for (const int type : {CV_8UC1, CV_16UC1}) expect_as_opencv(encoded(".pgm", scene(type)), "pgm");
}

// OpenCV makes nearly black ones of them.
TEST(Decode, APgmOfTenBitsIsScaledByItsGreatestGrey) {
  Bytes file;
  for (const char c : std::string("P5 # ten bits\n2 2\n1023\n")) file.push_back(static_cast<uint8_t>(c));
  for (const int grey : {0, 511, 512, 1023})
    file.insert(file.end(), {static_cast<uint8_t>(grey >> 8), static_cast<uint8_t>(grey)});
  const auto made = decoded(file, Pixels::grey);
  ASSERT_TRUE(made.status.ok()) << made.status.error().message;
  EXPECT_EQ(Bytes(made.picture.datastart, made.picture.dataend), (Bytes{0, 127, 127, 255}));
}

TEST(Decode, WhatIsNoPictureIsSaid) {
  EXPECT_EQ(problem({}), "is empty");
  EXPECT_EQ(problem({'G', 'I', 'F', '8'}), "is neither JPEG, PNG nor PGM");
  EXPECT_THAT(problem({'P', '5', '\n'}), HasSubstr("0x0 pixels"));
  const std::string huge = "P5\n999999 999999\n255\n";
  EXPECT_THAT(problem(Bytes(huge.begin(), huge.end())), HasSubstr("999999x999999 pixels"));
}

// libjpeg makes up what is missing: half a picture of rails, half of grey.
TEST(Decode, PicturesThatEndTooEarlyAreBroken) {
  for (const char* extension : {".jpg", ".png", ".pgm"}) {
    const Bytes whole = encoded(extension, scene(CV_8UC3).clone().reshape(1));
    for (const double part : {0.05, 0.3, 0.6, 0.95}) {
      const Bytes half(whole.begin(), whole.begin() + static_cast<ptrdiff_t>(part * static_cast<double>(whole.size())));
      EXPECT_THAT(problem(half), HasSubstr("is broken: ")) << extension << " " << part;
    }
  }
}

TEST(Decode, DamagedFilesHarmNothing) {
  std::mt19937 random(1);
  for (const char* extension : {".jpg", ".png", ".pgm"}) {
    const Bytes whole = encoded(extension, scene(CV_8UC1));
    for (int i = 0; i < 2000; ++i) {
      Bytes damaged = whole;
      for (int k = 0; k < 4; ++k) damaged[random() % (k < 2 ? 64 : damaged.size())] = static_cast<uint8_t>(random());
      (void)decoded(damaged, i % 2 == 0 ? Pixels::grey : Pixels::bgr);
    }
  }
}

}  // namespace
}  // namespace railfix::pictures
