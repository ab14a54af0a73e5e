#include "fusion/fix_residuals.hpp"

#include <gtest/gtest.h>

#include "core/median.hpp"

namespace railfix::fusion {
namespace {

TEST(FixResiduals, OfLandmarksThatKeepTheirWordSayNothing) {
  FixResiduals residuals;
  for (uint32_t landmark = 1; landmark < 20; ++landmark) residuals.add(landmark, 0.3, 2.0, 500);
  EXPECT_EQ(residuals.scatter_m(), 0);
  EXPECT_EQ(residuals.error_per_m(), 0);
}

TEST(FixResiduals, MostOfFiveAreBeyondTheirSigmaTwoAreNot) {
  FixResiduals residuals;
  for (uint32_t landmark = 1; landmark < 4; ++landmark) residuals.add(landmark, 0.1, 0.7, 500);
  for (uint32_t landmark = 4; landmark < 6; ++landmark) residuals.add(landmark, -1.5, 10, 500);
  EXPECT_EQ(residuals.scatter_m(), 0);
  residuals.add(6, 1.0, 7, 500);
  EXPECT_NEAR(residuals.scatter_m(), core::kSigmaOfMedian, 1e-9);
  for (uint32_t landmark = 7; landmark < 10; ++landmark) residuals.add(landmark, 0.1, 0.7, 500);
  EXPECT_EQ(residuals.scatter_m(), 0);
}

TEST(FixResiduals, TheSameLandmarkAgainIsNotCounted) {
  FixResiduals residuals;
  for (int i = 0; i < 9; ++i) residuals.add(5, 1.5, 10, 500);
  EXPECT_EQ(residuals.scatter_m(), 0);
}

TEST(FixResiduals, ALegThatWasNotAsLongAsExpectedDoubtsTheScaleForTwoLegs) {
  FixResiduals residuals;
  residuals.add(1, -8, 6, 800);
  EXPECT_NEAR(residuals.error_per_m(), 0.01, 1e-9);
  residuals.add(2, 0.1, 0.5, 800);
  EXPECT_NEAR(residuals.error_per_m(), 0.01, 1e-9);
  residuals.add(3, 0.1, 0.5, 800);
  EXPECT_EQ(residuals.error_per_m(), 0);
  residuals.add(4, 2, 9, 10);  // two landmarks side by side tell of themselves
  EXPECT_NEAR(residuals.error_per_m(), 0.01, 1e-9);
  residuals.add(5, 300, 9, 500);  // another place is no scale
  EXPECT_NEAR(residuals.error_per_m(), 0.03, 1e-9);
}

}  // namespace
}  // namespace railfix::fusion
