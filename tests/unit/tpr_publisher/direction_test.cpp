// Q_DIRTRAIN of trains that hardly move: whoever sets back, rolls back or only waits is where trackside looks at it.
#include <gtest/gtest.h>

#include <cmath>

#include "unit/tpr_publisher/publisher_fixture.hpp"

namespace railfix::tpr_publisher {
namespace {

using namespace testing;

/// Along A's nominal direction, reported at events only; fusion's rule says when it rests.
class SlowTrain {
 public:
  explicit SlowTrain(double rate_hz) : period_s_(1 / rate_hz) {}

  /// The place may be corrected by so much beside what the speed says. Nothing is reported in most steps.
  std::optional<Report> step(double acceleration_mps2, double corrected_m = 0, double speed_noise_mps = 0) {
    speed_mps += acceleration_mps2 * period_s_;
    place_m_ += speed_mps * period_s_ + corrected_m;
    run_s_ += period_s_;
    if (std::abs(place_m_ - rest_m_) > 0.05) {
      rest_m_ = place_m_;
      rest_since_s_ = run_s_;
    }
    auto position = at(forward(1, place_m_), run_s_, speed_mps + speed_noise_mps);
    position.standstill = rests();
    auto report = publisher_.update(position, position.stamp_ns).report;
    if (report) said = report->fields.q_dirtrain;
    return report;
  }
  [[nodiscard]] bool rests() const { return run_s_ - rest_since_s_ >= 1; }
  void brake_to_rest() {
    while (speed_mps > 0) step(-std::min(0.5, speed_mps / period_s_));
    while (!rests()) step(0);
  }

  double speed_mps = 0;
  uint32_t said = 99;  // Q_DIRTRAIN, in the last report

 private:
  static Settings seldom() {
    auto seldom = settings();
    seldom.parameters.t_cycloc = etcs::kNoCycleTime;
    return seldom;
  }
  double period_s_;
  double place_m_ = 150;
  double rest_m_ = 150;
  double run_s_ = 0;
  double rest_since_s_ = 0;
  TprPublisher publisher_{balise_map(), seldom()};
};

TEST(Direction, ATrainThatSetsBackSaysSoWithItsFirstMovement) {
  for (const double rate_hz : {20.0, 40.0, 80.0}) {
    for (const double acceleration_mps2 : {0.05, 0.1, 0.2, 0.5}) {
      for (int k = 0; k < 10; ++k) {
        SlowTrain train(rate_hz);
        train.speed_mps = 3 + 0.013 * k;
        train.brake_to_rest();
        ASSERT_EQ(train.said, etcs::kNominal);
        std::optional<Report> report;
        while (!report) report = train.step(-acceleration_mps2);
        EXPECT_EQ(report->reason, Reason::moving);
        EXPECT_EQ(report->fields.q_dirtrain, etcs::kReverse) << rate_hz << " Hz, " << acceleration_mps2 << " m/s2";
      }
    }
  }
}

// Seen to move before the estimate knows which way: what was said does not stand until the cycle is over.
TEST(Direction, AnotherOneThanWasSaidIsReported) {
  SlowTrain train(20);
  train.speed_mps = 3;
  train.brake_to_rest();
  ASSERT_TRUE(train.step(0, 0.06)) << "a correction ended the rest";
  EXPECT_EQ(train.said, etcs::kNominal);
  for (int i = 0; i < 10; ++i) ASSERT_FALSE(train.step(0));
  std::optional<Report> report;
  for (int i = 0; i < 40 && !report; ++i) report = train.step(-0.5);
  ASSERT_TRUE(report.has_value());
  EXPECT_EQ(report->reason, Reason::moving);
  EXPECT_EQ(report->fields.q_dirtrain, etcs::kReverse);
  for (int i = 0; i < 40; ++i) EXPECT_FALSE(train.step(-0.5));
}

TEST(Direction, ACorrectionBackWhileItCreepsToAStopIsNoMovement) {
  for (const double corrected_m : {-1.9, -2.1, -5.0}) {
    SlowTrain train(20);
    train.speed_mps = 3;
    bool corrected = false;
    for (int i = 0; !train.rests(); ++i) {
      const bool now = !corrected && train.speed_mps < 0.1;
      corrected = corrected || now;
      train.step(-std::min(0.3, train.speed_mps * 20), now ? corrected_m : 0, i % 2 == 0 ? -0.04 : 0.04);
    }
    EXPECT_EQ(train.said, etcs::kNominal) << corrected_m;
  }
}

TEST(Direction, ACorrectionBeforeTheFirstMovementIsNone) {
  for (const double corrected_m : {-5.0, -0.06, 0.06, 5.0}) {
    for (const double noise_mps : {-0.003, 0.0, 0.003}) {
      SlowTrain train(20);
      for (int i = 0; i < 120; ++i) train.step(0, i == 60 ? corrected_m : 0, noise_mps);
      EXPECT_EQ(train.said, etcs::kUnknownSide) << corrected_m;
      train.brake_to_rest();
      for (int i = 0; i < 40 && train.said == etcs::kUnknownSide; ++i) train.step(0.1);
      EXPECT_EQ(train.said, etcs::kNominal) << corrected_m;
    }
  }
}

TEST(Direction, AGapAndACorrectionAtRestGiveNone) {
  auto often = settings();
  often.parameters.t_cycloc = 1;
  TprPublisher publisher(balise_map(), often);
  uint32_t said = 99;
  const auto follow = [&](double offset_m, double run_s, double speed_mps) {
    const auto position = at(forward(1, offset_m), run_s, speed_mps);
    if (const auto report = publisher.update(position, position.stamp_ns).report) said = report->fields.q_dirtrain;
  };
  for (int i = 0; i < 10; ++i) follow(150 + i, 0.05 * i, 20);
  EXPECT_EQ(said, etcs::kNominal);
  for (int i = 0; i < 60; ++i) follow(i < 30 ? 159 : 158.94, 5 + 0.05 * i, 0);
  EXPECT_EQ(said, etcs::kUnknownSide);
}

// A speed that is a little off for ten minutes is no way.
TEST(Direction, TheSpeedsErrorAtALongHaltIsNoMovement) {
  SlowTrain train(20);
  train.speed_mps = 3;
  train.brake_to_rest();
  for (int i = 0; i < 12'000; ++i) train.step(0, 0, -0.002);
  std::optional<Report> report = train.step(0, 0.06, -0.002);
  ASSERT_TRUE(report.has_value());
  EXPECT_EQ(report->fields.q_dirtrain, etcs::kNominal);
}

}  // namespace
}  // namespace railfix::tpr_publisher
