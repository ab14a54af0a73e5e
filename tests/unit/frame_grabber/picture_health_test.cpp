#include "frame_grabber/picture_health.hpp"

#include <gtest/gtest.h>

#include "core/random.hpp"

namespace railfix::frame_grabber {
namespace {

cv::Mat noise(uint64_t seed, int low, int high) {
  core::Random random(seed);
  cv::Mat picture(120, 160, CV_8UC1);
  for (int i = 0; i < 120 * 160; ++i) picture.data[i] = static_cast<uint8_t>(random.uniform(low, high));
  return picture;
}

TEST(PictureHealth, GoodPicturesHaveNoFlags) {
  PictureHealth health({});
  for (uint64_t i = 0; i < 20; ++i) EXPECT_EQ(health.judge(static_cast<int64_t>(i), noise(i, 20, 200)), 0U);
}

TEST(PictureHealth, DarkAndSaturated) {
  PictureHealth health({});
  EXPECT_EQ(health.judge(1, noise(1, 0, 12)), kDark);
  cv::Mat lamp = noise(2, 0, 12);
  lamp.colRange(0, 16).setTo(200);  // a tenth of the picture is lit: a tunnel with a lamp
  EXPECT_EQ(health.judge(2, lamp), 0U);
  EXPECT_EQ(health.judge(3, noise(3, 250, 256)), kSaturated);
  cv::Mat sky = noise(4, 40, 200);
  sky.rowRange(0, 36).setTo(255);  // 30 %
  EXPECT_EQ(health.judge(4, sky), 0U);
  sky.rowRange(0, 60).setTo(255);
  EXPECT_EQ(health.judge(5, sky), kSaturated);
}

TEST(PictureHealth, FrozenOnlyAfterSoManyEqualPictures) {
  PictureHealthConfig config;
  config.frozen_after_pictures = 3;
  PictureHealth health(config);
  const cv::Mat still = noise(7, 20, 200);
  for (int64_t i = 0; i < 3; ++i) EXPECT_EQ(health.judge(i, still.clone()), 0U) << i;
  EXPECT_EQ(health.judge(3, still.clone()), kFrozen);
  cv::Mat other = still.clone();
  other.at<uint8_t>(60, 81) ^= 1U;  // off the coarse grid
  EXPECT_EQ(health.judge(4, other), 0U);
}

TEST(PictureHealth, StampsThatDoNotGrowAreOutOfOrder) {
  PictureHealth health({});
  EXPECT_EQ(health.judge(10, noise(1, 20, 200)), 0U);
  EXPECT_EQ(health.judge(10, noise(2, 20, 200)), kOutOfOrder);
  EXPECT_EQ(health.judge(9, noise(3, 20, 200)), kOutOfOrder);
  EXPECT_EQ(health.judge(11, noise(4, 20, 200)), 0U);
}

TEST(PictureHealth, PicturesSmallerThanTheGridAndPartsOfLargerOnes) {
  PictureHealth health({});
  EXPECT_EQ(health.judge(1, cv::Mat(1, 1, CV_8UC1, cv::Scalar(100))), 0U);
  EXPECT_EQ(health.judge(2, noise(1, 20, 200)(cv::Rect(3, 5, 50, 40))), 0U);
}

}  // namespace
}  // namespace railfix::frame_grabber
