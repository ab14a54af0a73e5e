// Pictures that show two motions: what stays in the picture while the train leaves, and what leaves while it stands.
#include <gtest/gtest.h>

#include <cmath>
#include <opencv2/imgproc.hpp>

#include "core/time.hpp"
#include "odometry/train_mouse.hpp"
#include "unit/odometry/synthetic_ground.hpp"

namespace railfix::odometry {
namespace {

using test::SyntheticGround;

constexpr double kDoubtRateHz = 20;

// Smooth noise of unit contrast, as far across as `sigma` cells.
cv::Mat blobs_of(double sigma) {
  core::Random random(11);
  cv::Mat noise(512, 640, CV_32F);
  for (int i = 0; i < noise.rows * noise.cols; ++i) noise.ptr<float>()[i] = static_cast<float>(random.normal());
  cv::GaussianBlur(noise, noise, cv::Size(0, 0), sigma);
  cv::Scalar mean;
  cv::Scalar contrast;
  cv::meanStdDev(noise, mean, contrast);
  return noise / contrast[0];
}

class Watched {
 public:
  Watched() : ground_(1, {}), mouse_(test::small_camera(), {}) {}
  MouseStep at(double time_s, double distance_m) {
    MousePicture picture;
    picture.grey = ground_.picture(test::small_camera(), test::cab_mount(), distance_m, light);
    picture.stamp_ns = core::kNsPerSecond + core::to_ns(time_s);
    picture.pose = test::cab_mount();
    picture.pose_measured = true;
    picture.trust = PoseTrust::independent(0.0003, 0.002);
    return mouse_.process(picture);
  }
  SyntheticGround::Light light;

 private:
  SyntheticGround ground_;
  TrainMouse mouse_;
};

// A train that stands for half a second and leaves with 1.5 m/s2.
double gone_m(int picture) {
  const double since_s = std::max(0.0, picture / kDoubtRateHz - 0.5);
  return 0.75 * since_s * since_s;
}

TEST(TrainMouseDoubt, APatternOnThePaneDoesNotHoldALeavingTrain) {
  const cv::Mat pattern = blobs_of(4);
  Watched train;
  train.light.glare = [&](double u, double v) {
    return 55.0 * pattern.at<float>(static_cast<int>(v), static_cast<int>(u));
  };
  int right_at_rest = 0;
  for (int i = 0; i <= 70; ++i) {
    const MouseStep step = train.at(i / kDoubtRateHz, gone_m(i));
    if (i > 2 && gone_m(i) == 0) right_at_rest += step.valid ? 1 : 0;
    if (step.valid) {
      EXPECT_NEAR(step.distance_m, gone_m(i), 0.03) << i;
    }
  }
  EXPECT_EQ(right_at_rest, 8) << "a pattern is no reason to doubt a train that stands";
}

// Leaves' shadows, or those of a train that leaves beside this one.
TEST(TrainMouseDoubt, ShadowsThatMoveOverTheGroundAreNoMotion) {
  const cv::Mat leaves = blobs_of(7);  // of 2 cm
  for (const double shadow_mps : {0.2, 0.5, 1.0, 4.0}) {
    Watched train;
    double time_s = 0;
    train.light.cast = [&](double along_m, double left_m) {
      const int row = static_cast<int>(std::floor((along_m + shadow_mps * time_s) / 0.02)) % leaves.rows;
      return leaves.at<float>(row, static_cast<int>((left_m + 2) / 0.02)) > 0 ? 0.5 : 1.0;
    };
    double way_m = 0;
    int valid = 0;
    for (int i = 0; i <= 40; ++i) {
      time_s = i / kDoubtRateHz;
      const MouseStep step = train.at(time_s, 0);
      if (step.valid) way_m = std::max(way_m, std::abs(step.distance_m));
      valid += step.valid ? 1 : 0;
    }
    EXPECT_LT(way_m, 0.05) << shadow_mps;
    EXPECT_LT(valid, 20) << shadow_mps;  // the slowest shows after half a second
  }
}

// Nothing but light changes: the train stands and leaves, and there is no doubt.
TEST(TrainMouseDoubt, ALeavingTrainIsNotDoubted) {
  Watched train;
  for (int i = 0; i <= 50; ++i) {
    train.light.gain = 1 - 0.3 * std::sin(0.2 * i);
    const MouseStep step = train.at(i / kDoubtRateHz, gone_m(i));
    EXPECT_EQ(step.valid, i >= 2) << i;
    if (step.valid) {
      EXPECT_NEAR(step.distance_m, gone_m(i), 0.02) << i;
    }
  }
}

}  // namespace
}  // namespace railfix::odometry
