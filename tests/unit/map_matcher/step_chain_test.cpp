// Steps of one odometry process, of one that began anew, and with pictures between them that nobody measured.
#include "map_matcher/step_chain.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "core/time.hpp"

namespace railfix::map_matcher::step_chain_test {
namespace {

constexpr double kPeriodS = 0.1;
constexpr double kSpeedMps = 10;
constexpr double kCurvaturePerM = 0.001;

/// Picture `k` measured against picture `reference`; the train runs at 10 m/s through a curve of 1000 m.
StepInput step(int k, int reference, double distance_m) {
  const double way_m = kSpeedMps * kPeriodS * (k - reference);
  return {core::to_ns(100 + kPeriodS * k),
          core::to_ns(100 + kPeriodS * reference),
          true,
          way_m,
          kCurvaturePerM * way_m,
          1e-4,
          distance_m,
          kSpeedMps};
}

TEST(StepChain, AddsWayAndTurnOfPicturesAndOfKeyFrames) {
  StepChain chain;
  chain.add(step(1, 0, 1));
  EXPECT_TRUE(chain.broken()) << "nothing is known of what came before the first step";
  chain.add(step(2, 1, 2));
  EXPECT_FALSE(chain.broken());
  EXPECT_NEAR(chain.odometer_m(), 1, 1e-9);
  EXPECT_NEAR(chain.turn()->turn_rad, 0.001, 1e-9);
  chain.add(step(3, 1, 3));  // the same picture again: only what it grew by
  EXPECT_NEAR(chain.turn()->way_m, 1, 1e-9);
  EXPECT_NEAR(chain.turn()->turn_rad, 0.001, 1e-9);
  chain.add(step(4, 2, 4));  // another one further back: its share
  EXPECT_NEAR(chain.turn()->turn_rad, 0.001, 1e-9);
  EXPECT_NEAR(chain.odometer_m(), 3, 1e-9);
}

TEST(StepChain, AnotherProcessCountsFromZeroAndTheWayGoesOn) {
  StepChain chain;
  chain.add(step(1, 0, 8700));
  chain.add(step(2, 1, 8701));
  // It was warm already, beside the other one: its first step begins at a picture that both saw.
  chain.add(step(3, 2, 1));
  EXPECT_FALSE(chain.broken());
  EXPECT_NEAR(chain.odometer_m(), 2, 1e-9);
  EXPECT_NEAR(chain.turn()->way_m, 1, 1e-9);
  EXPECT_NEAR(chain.turn()->turn_rad, 0.001, 1e-9);
  // Ten seconds later, with nothing between: nobody knows this way.
  chain.add(step(103, 102, 0.7));
  EXPECT_TRUE(chain.broken());
  EXPECT_FALSE(chain.turn());
  EXPECT_NEAR(chain.odometer_m(), 2, 1e-9);
  chain.add(step(104, 103, 1.7));
  EXPECT_NEAR(chain.turn()->way_m, 1, 1e-9);
  EXPECT_NEAR(chain.odometer_m(), 3, 1e-9);
}

TEST(StepChain, StepsThatAreMissingCostTheTurnNotTheWay) {
  StepChain chain;
  chain.add(step(1, 0, 1));
  chain.add(step(2, 1, 2));
  chain.add(step(6, 5, 6));
  EXPECT_FALSE(chain.broken());
  EXPECT_NEAR(chain.odometer_m(), 5, 1e-9);
  EXPECT_FALSE(chain.turn()) << "the train may have turned between pictures 2 and 5";
}

TEST(StepChain, BlindPicturesAndStampsThatGoBackBreakIt) {
  StepChain chain;
  chain.add(step(1, 0, 1));
  auto blind = step(2, 1, 1);
  blind.measured = false;
  chain.add(blind);
  EXPECT_TRUE(chain.broken());
  chain.add(step(3, 2, 3));
  EXPECT_TRUE(chain.broken());
  chain.add(step(4, 3, 4));
  EXPECT_FALSE(chain.broken());
  chain.add(step(4, 3, 4));
  EXPECT_TRUE(chain.broken());
  auto nonsense = step(5, 4, NAN);
  chain.add(nonsense);
  EXPECT_FALSE(chain.broken()) << "the pictures tell";
  EXPECT_NEAR(chain.odometer_m(), 2, 1e-9);
}

}  // namespace
}  // namespace railfix::map_matcher::step_chain_test
