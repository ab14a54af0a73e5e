// A track looks alike one sleeper further on: the step from picture to picture must not be wrong by that.
#include "track_detector/ground_motion.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <opencv2/imgproc.hpp>

#include "core/random.hpp"
#include "core/time.hpp"
#include "core/units.hpp"

namespace railfix::track_detector {
namespace {

constexpr double kStepM = 0.74;  // 160 km/h at 60 Hz
constexpr double kSleeperM = 0.6;

class Ground : public testing::Test {
 protected:
  Ground() {
    sheet_.near_m = 3.5;
    sheet_.rows = 300;
    sheet_.cols = 60;
    core::Random random(5);
    ballast_ = cv::Mat(kLongRows, sheet_.cols, CV_32F);
    for (auto it = ballast_.begin<float>(); it != ballast_.end<float>(); ++it)
      *it = static_cast<float>(random.normal());
    cv::GaussianBlur(ballast_, ballast_, {}, 1.5);
  }
  /// Another picture, behind this way.
  std::optional<double> run(double way_m, int64_t time_ns = core::kNsPerSecond / 60) {
    way_m_ += way_m;
    stamp_ns_ += time_ns;
    vision::TopView view;
    view.grey = cv::Mat(sheet_.rows, sheet_.cols, CV_32F);
    view.row_seen.assign(static_cast<size_t>(sheet_.rows), 1);
    for (int row = 0; row < sheet_.rows; ++row) {
      const double m = way_m_ + sheet_.ahead_m(row);
      const auto sleeper = static_cast<float>(100 + 30 * std::cos(2 * core::kPi * m / kSleeperM));
      const auto* stones = ballast_.ptr<float>(static_cast<int>(std::lround(m / sheet_.cell_m)) % kLongRows);
      for (int col = 0; col < sheet_.cols; ++col) view.grey.at<float>(row, col) = sleeper + 180.0F * stones[col];
    }
    return motion_.step(view, sheet_, stamp_ns_);
  }
  static constexpr int kLongRows = 20000;
  vision::Sheet sheet_;
  cv::Mat ballast_;
  double way_m_ = 0;
  int64_t stamp_ns_ = core::kNsPerSecond;
  GroundMotion motion_{60};
};

// Over points the other rails run across the sheet: two steps in a row may look too short.
TEST_F(Ground, ABadStepOrTwoDoNotLeadToTheNextSleeper) {
  for (int i = 0; i < 60; ++i) run(kStepM);
  for (const double bad_m : {0.56, 0.3, 0.12}) run(bad_m);
  for (int i = 0; i < 10; ++i) run(kStepM);
  const auto step_m = run(kStepM);
  ASSERT_TRUE(step_m);
  EXPECT_NEAR(*step_m, kStepM, 0.02);
}

TEST_F(Ground, AStepThatIsWrongByASleeperIsFoundOut) {
  for (int i = 0; i < 10; ++i) run(kStepM - kSleeperM);
  const auto wrong_m = run(kStepM);
  ASSERT_TRUE(wrong_m);
  ASSERT_NEAR(*wrong_m, kStepM - kSleeperM, 0.03);
  for (int i = 0; i < 75; ++i) run(kStepM);
  const auto step_m = run(kStepM);
  ASSERT_TRUE(step_m);
  EXPECT_NEAR(*step_m, kStepM, 0.02);
}

// The way of a gap is not the speed before it times its length, nor what fits by chance near there.
TEST_F(Ground, AfterAGapNothingIsKnown) {
  for (int i = 0; i < 20; ++i) run(kStepM);
  EXPECT_FALSE(run(2.0, core::kNsPerSecond * 6 / 10));
  EXPECT_FALSE(run(0.2));
  const auto step_m = run(0.2);
  ASSERT_TRUE(step_m);
  EXPECT_NEAR(*step_m, 0.2, 0.02);
}

}  // namespace
}  // namespace railfix::track_detector
