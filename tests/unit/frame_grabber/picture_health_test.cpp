#include "frame_grabber/picture_health.hpp"

#include <gtest/gtest.h>

#include <functional>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "core/random.hpp"
#include "core/time.hpp"

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

TEST(PictureHealth, ARepeatIsFrozenAtOnceAlsoWhenBuffersTakeTurns) {
  PictureHealth health({});
  EXPECT_EQ(health.judge(1, noise(1, 20, 200)), 0U);
  EXPECT_EQ(health.judge(2, noise(2, 20, 200)), 0U);
  EXPECT_EQ(health.judge(3, noise(1, 20, 200)), kFrozen);
  EXPECT_EQ(health.judge(4, noise(2, 20, 200)), kFrozen);
  EXPECT_EQ(health.judge(5, noise(3, 20, 200)), 0U);
}

/// Ballast, twice as high as a picture, and pictures of it with noise of their own.
class PictureHealthOnTheWay : public ::testing::Test {
 protected:
  PictureHealthOnTheWay() {
    core::Random random(11);
    for (auto* value = ballast_.data; value != ballast_.dataend; ++value) {
      *value = static_cast<uint8_t>(random.uniform(0, 256));
    }
    cv::GaussianBlur(ballast_, ballast_, {}, 1.0);
    cv::normalize(ballast_, ballast_, 30, 220, cv::NORM_MINMAX);
  }
  cv::Mat picture(int number, bool moves) {
    const int from = moves ? number * 37 % 500 : 0;
    cv::Mat shown = ballast_.rowRange(from, from + 512).clone();
    return shown;
  }
  /// So many pictures at 10 Hz; the last one's health.
  uint32_t run(int pictures, bool moves, const std::function<void(cv::Mat&)>& spoil) {
    uint32_t flags = 0;
    for (int i = 0; i < pictures; ++i, ++number_) {
      cv::Mat shown = picture(number_, moves);
      spoil(shown);
      cv::Mat noise(shown.size(), CV_8UC1);
      cv::theRNG().state = static_cast<uint64_t>(number_);
      cv::randn(noise, 6, 2);
      shown += noise;
      flags = health_.judge(number_ * 100'000'000LL, shown);
      if (flags != 0) ++flagged_;
    }
    return flags;
  }
  cv::Mat ballast_ = cv::Mat(1024, 640, CV_8UC1);
  PictureHealth health_ = PictureHealth(PictureHealthConfig());
  int number_ = 1;
  int flagged_ = 0;
};

TEST_F(PictureHealthOnTheWay, MovingAndStandingAreNotFlagged) {
  run(100, true, [](cv::Mat&) {});
  run(200, false, [](cv::Mat&) {});
  run(50, true, [](cv::Mat& m) { cv::blur(m, m, {1, 25}); });  // fast
  EXPECT_EQ(flagged_, 0);
}

/// Ballast that runs by at 30 Hz under a camera with noise of its own.
class PictureShownAgain : public PictureHealthOnTheWay {
 protected:
  cv::Mat at(double pixels, bool noisy = true) {
    const auto whole = static_cast<int>(pixels);
    cv::Mat here = ballast_.rowRange(whole, whole + 512).clone();
    cv::addWeighted(here, whole + 1 - pixels, ballast_.rowRange(whole + 1, whole + 513), pixels - whole, 0, here);
    if (!noisy) return here;
    cv::Mat noise(here.size(), CV_8UC1);
    cv::theRNG().state = static_cast<uint64_t>(number_ + 1);
    cv::randn(noise, 6, 2);
    return here + noise;
  }
  uint32_t show(const cv::Mat& shown) { return health_.judge(number_++ * 33'333'333LL, shown); }
  static cv::Mat coded_anew(const cv::Mat& shown) {
    std::vector<uint8_t> jpeg;
    cv::imencode(".jpg", shown, jpeg, {cv::IMWRITE_JPEG_QUALITY, 90});
    return cv::imdecode(jpeg, cv::IMREAD_GRAYSCALE);
  }
};

TEST_F(PictureShownAgain, IsFrozenThoughItWasCodedAnew) {
  for (const int every : {2, 6}) {  // 15 and 25 Hz made to 30
    cv::Mat last;
    for (int i = 0; i < 60; ++i) {
      const bool repeat = i % every == every - 1;
      const uint32_t flags = show(repeat ? coded_anew(last) : last = at(i * 7));
      EXPECT_TRUE(flags == (repeat ? kFrozen : 0U) || i < 12) << every << ' ' << i;
    }
  }
}

TEST_F(PictureShownAgain, IsToldFromAStopForSomeSeconds) {
  for (int i = 0; i < 20; ++i) EXPECT_EQ(show(at(i * 7)), 0U);
  const cv::Mat last = at(20 * 7);
  EXPECT_EQ(show(last), 0U);
  cv::Mat other = last.clone();
  for (int i = 0; i < 140; ++i) {
    other.at<uint8_t>(100, i) ^= 1U;
    EXPECT_EQ(show(other), kFrozen) << i;
  }
  for (int i = 140; i < 160; ++i) {
    other.at<uint8_t>(100, i) ^= 1U;
    (void)show(other);
  }
  other.at<uint8_t>(100, 160) ^= 1U;
  EXPECT_EQ(show(other), 0U) << "by now a train may stand";
}

// Also with a camera that has next to no noise.
TEST_F(PictureShownAgain, AStoppingAndAStandingTrainAreNotFrozen) {
  for (const bool noisy : {true, false}) {
    for (const double slowest_px : {0.0, 0.3}) {
      PictureHealth health({});
      double at_px = 0;
      for (int i = 0; i < 200; ++i, ++number_) {
        if (i < 60) at_px += 0.1 * (60 - i) + slowest_px;
        cv::Mat shown = at(at_px, noisy);
        shown.at<uint8_t>(100, i) ^= 1U;
        EXPECT_EQ(health.judge(i * 33'333'333LL, shown) & kFrozen, 0U) << noisy << ' ' << slowest_px << ' ' << i;
      }
    }
  }
}

TEST_F(PictureHealthOnTheWay, BlurIsFlaggedWhenItLastsAndRecovers) {
  const auto defocus = [](cv::Mat& m) { cv::GaussianBlur(m, m, {}, 3.5); };
  run(20, true, [](cv::Mat&) {});
  run(20, true, defocus);
  EXPECT_EQ(flagged_, 0) << "two seconds are not long enough";
  EXPECT_EQ(run(10, true, defocus), kBlurred);
  EXPECT_EQ(run(1, true, [](cv::Mat&) {}), 0U);
}

TEST_F(PictureHealthOnTheWay, CondensationTakesAllEdges) {
  run(20, true, [](cv::Mat&) {});
  const auto mist = [](cv::Mat& m) {
    cv::GaussianBlur(m, m, {}, 5);
    m.convertTo(m, -1, 0.5, 60);
  };
  EXPECT_EQ(run(30, true, mist) & kBlurred, kBlurred);
}

TEST_F(PictureHealthOnTheWay, ACoverWithoutStructureAndAStandingOne) {
  run(20, true, [](cv::Mat&) {});
  EXPECT_EQ(run(25, true, [](cv::Mat& m) { m.rowRange(300, 512).setTo(90); }), kCovered);
  EXPECT_EQ(run(1, true, [](cv::Mat&) {}), 0U);
  flagged_ = 0;
  cv::Mat leaf = ballast_(cv::Rect(0, 0, 640, 170)).clone();
  const auto stuck = [&leaf](cv::Mat& m) { leaf.copyTo(m.rowRange(342, 512)); };
  EXPECT_EQ(run(80, true, stuck), kCovered);
  run(1, true, [](cv::Mat&) {});
  EXPECT_EQ(run(30, true, [](cv::Mat&) {}), 0U);
  flagged_ = 0;
  run(200, false, stuck);
  EXPECT_EQ(flagged_, 0) << "at a standstill it cannot be told";
}

TEST(PictureHealth, WatchesTheTrackAndNotTheSky) {
  geometry::Intrinsics camera{500, 500, 320, 256, 0, 0, 0, 0, 640, 512};
  PictureHealth health({});
  health.watch_track(camera, {0, 0.2, 0, 0, 2.5});
  cv::Mat picture = noise(1, 20, 200);
  cv::resize(picture, picture, cv::Size(640, 512), 0, 0, cv::INTER_NEAREST);
  picture.rowRange(0, 200).setTo(180);
  (void)health.judge(1, picture);
  EXPECT_EQ(health.covered_share(), 0.0);
  picture.rowRange(200, 512).setTo(100);
  (void)health.judge(2, picture);
  EXPECT_EQ(health.covered_share(), 1.0);
}

TEST(PictureHealth, StampsThatDoNotGrowAreOutOfOrder) {
  PictureHealth health({});
  EXPECT_EQ(health.judge(10, noise(1, 20, 200)), 0U);
  EXPECT_EQ(health.judge(10, noise(2, 20, 200)), kOutOfOrder);
  EXPECT_EQ(health.judge(9, noise(3, 20, 200)), kOutOfOrder);
  EXPECT_EQ(health.judge(11, noise(4, 20, 200)), 0U);
}

TEST(PictureHealth, AfterAClockWasSetBackOnlyOnePictureIsOutOfOrder) {
  PictureHealth health({});
  constexpr int64_t kHourNs = 3600 * core::kNsPerSecond;
  EXPECT_EQ(health.judge(2 * kHourNs, noise(1, 20, 200)), 0U);
  EXPECT_EQ(health.judge(kHourNs, noise(2, 20, 200)), kOutOfOrder);
  EXPECT_EQ(health.judge(kHourNs + 1, noise(3, 20, 200)), 0U);
}

TEST(PictureHealth, PicturesSmallerThanTheGridAndPartsOfLargerOnes) {
  PictureHealth health({});
  EXPECT_EQ(health.judge(1, cv::Mat(1, 1, CV_8UC1, cv::Scalar(100))), 0U);
  EXPECT_EQ(health.judge(2, noise(1, 20, 200)(cv::Rect(3, 5, 50, 40))), 0U);
}

}  // namespace
}  // namespace railfix::frame_grabber
