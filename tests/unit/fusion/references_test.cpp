// What landmarks and the search on the map say of the place, and how far one of them is believed.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "straight_run.hpp"

namespace railfix::fusion {
namespace {

using testing::HasSubstr;

TEST(References, NetworkFixStartsThePosition) {
  auto fusion = fusion_without_start();
  run(fusion, 0, 10, 20);
  FixInput fix = fix_at(10, 4000, 0, 0.99);
  fix.kind = FixKind::network;
  fix.sigma_m = 3;
  fix.direction = track::Direction::reverse;
  fusion.add(fix);
  const auto state = run(fusion, 10, 11, 20);
  EXPECT_TRUE(state.track_known);
  EXPECT_NEAR(state.position.offset_m, 3980, 0.1);
  EXPECT_EQ(state.position.direction, track::Direction::reverse);
  EXPECT_NEAR(state.distance_m, 220, 0.1);
  EXPECT_GT(state.over_m, 4 * 3);
  EXPECT_LT(state.over_m, 20);
}

TEST(References, LandmarkIsIgnoredWhilePlaceIsUnknown) {
  auto fusion = fusion_without_start();
  run(fusion, 0, 1, 20);
  fusion.add(fix_at(1, 4000, 7));
  EXPECT_FALSE(run(fusion, 1, 2, 20).track_known);
}

TEST(References, TwoLandmarksCalibrateTheCamerasScale) {
  auto fusion = fusion_at(0);
  double place_m = 0;
  for (int k = 1; k <= 5; ++k) {
    run(fusion, (k - 1) * 20.0, k * 20.0, 20);  // the camera says 400 m, truly it is 1 % more
    place_m = k * 404.0;
    fusion.add(fix_at(k * 20.0, place_m, static_cast<uint32_t>(k)));
  }
  const auto state = run(fusion, 100, 120, 20);
  EXPECT_NEAR(state.visual_scale, 1.01, 0.001);
  EXPECT_NEAR(state.position.offset_m, place_m + 404, 0.8);
  EXPECT_EQ(state.reference, 5U);
  EXPECT_NEAR(state.since_reference_m, 404, 1.0);
  EXPECT_EQ(state.integrity, Integrity::ok) << state.reason;
}

TEST(References, OneFalseFixNeverMovesTheTrain) {
  auto fusion = fusion_at(0);
  run(fusion, 0, 10, 20);
  fusion.add(fix_at(10, 260, 3));
  const auto state = run(fusion, 10, 11, 20);
  EXPECT_NEAR(state.position.offset_m, 220, 0.1);
  EXPECT_THAT(state.reason, HasSubstr("a position fix was refused"));
  EXPECT_GT(state.under_m, 60);  // but the interval admits that it may be right
  EXPECT_LT(state.over_m, 20);
}

TEST(References, TwoFixesThatAgreeMoveTheTrain) {
  auto fusion = fusion_at(0);
  run(fusion, 0, 10, 20);
  fusion.add(fix_at(10, 260, 3));
  run(fusion, 10, 15, 20);
  fusion.add(fix_at(15, 360, 4));
  const auto state = run(fusion, 15, 16, 20);
  EXPECT_NEAR(state.position.offset_m, 380, 1);
  EXPECT_EQ(state.integrity, Integrity::degraded);
}

// A false fix inside the interval is found out by the next one, and the interval held the truth meanwhile.
TEST(References, FalseFixInsideTheIntervalIsUndoneByTheNext) {
  auto fusion = fusion_at(0);
  run(fusion, 0, 20, 20);
  fusion.add(fix_at(20, 410, 3, 0.99));
  const auto misled = run(fusion, 20, 30, 20);
  EXPECT_GT(misled.position.offset_m, 605);
  EXPECT_GT(misled.over_m, misled.position.offset_m - 600);
  fusion.add(fix_at(30, 600, 4, 0.99));
  const auto state = run(fusion, 30, 31, 20);
  EXPECT_NEAR(state.position.offset_m, 620, 0.5);
  EXPECT_EQ(state.reference, 4U);
}

TEST(References, ImprobableAndForeignFixesAreLeftOut) {
  auto fusion = fusion_at(0);
  run(fusion, 0, 10, 20);
  fusion.add(fix_at(10, 203, 3, 0.5));
  FixInput foreign = fix_at(10.01, 100, 4);
  foreign.edge = 77;
  fusion.add(foreign);
  const auto state = run(fusion, 10, 11, 20);
  EXPECT_NEAR(state.position.offset_m, 220, 0.1);
  EXPECT_EQ(state.reference, 0U);
  EXPECT_THAT(state.reason, HasSubstr("another track"));
}

/// A train that runs 20 m/s by its camera, which counts `scale` true metres a metre, over landmarks every so often.
class Passage {
 public:
  explicit Passage(double scale) : scale_(scale) {}
  /// Runs to the true place; every state must hold the train.
  void run_to(double place_m) {
    while (place_m_ < place_m) {
      const double step_m = 20 * 0.02;
      t_s_ += 0.02;
      place_m_ += scale_ * step_m;
      state_ = fusion_.add(OdometryInput{at(t_s_), at(t_s_ - 0.02), step_m, 0.001, true});
      ASSERT_TRUE(state_);
      const double error_m = state_->position.offset_m - place_m_;
      ASSERT_LT(error_m, state_->over_m) << "at " << place_m_ << " m";
      ASSERT_LT(-error_m, state_->under_m) << "at " << place_m_ << " m";
    }
  }
  /// A landmark here, sighted so far ahead of where it is.
  void sight(double wrong_m) { fusion_.add(fix_at(t_s_, place_m_ + wrong_m, ++landmark_, 0.999999)); }
  [[nodiscard]] double error_m() const { return state_->position.offset_m - place_m_; }
  [[nodiscard]] double scale_error() const { return state_->visual_scale - scale_; }

 private:
  Fusion fusion_ = fusion_at(0);
  double scale_;
  double t_s_ = 0;
  double place_m_ = 0;
  uint32_t landmark_ = 0;
  std::optional<TrainEstimate> state_;
};

// However sure and sharp: a portal may be sighted metres off.
TEST(References, AWrongSightingCostsAccuracyUntilTheNextOnesAndTheIntervalHolds) {
  for (const double scale : {0.995, 1.0, 1.008}) {
    for (const double wrong_m : {-3.0, -1.0, 1.0, 2.0, 3.0}) {
      Passage passage(scale);
      passage.run_to(600);
      passage.sight(0);
      passage.run_to(1100);
      passage.sight(wrong_m);
      passage.run_to(2600);
      EXPECT_GT(std::abs(passage.error_m()), 0.5 * std::abs(wrong_m));  // it was believed
      passage.sight(0.1);
      passage.run_to(3200);
      passage.sight(-0.1);
      passage.run_to(4200);
      EXPECT_LT(std::abs(passage.error_m()), 0.5) << scale << " " << wrong_m;
      EXPECT_LT(std::abs(passage.scale_error()), 4e-4) << scale << " " << wrong_m;
    }
  }
}

TEST(References, EverySecondSightingMayBeWrong) {
  Passage passage(1.003);
  double place_m = 0;
  for (const double wrong_m : {0.05, 2.26, 0.1, -0.05, 0.1, -1.5, 0.05, 3.0, -0.1}) {
    passage.run_to(place_m += 700);
    passage.sight(wrong_m);
  }
  passage.run_to(place_m + 1500);
  EXPECT_LT(std::abs(passage.error_m()), 1.0);
}

}  // namespace
}  // namespace railfix::fusion
