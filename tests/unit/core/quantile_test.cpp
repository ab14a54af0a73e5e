#include "core/quantile.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

namespace railfix::core {
namespace {

TEST(Quantile, LiesBetweenTheTwoNearestRanks) {
  const std::vector<double> values{0, 1, 2, 10};
  EXPECT_DOUBLE_EQ(quantile(values, 0), 0);
  EXPECT_DOUBLE_EQ(quantile(values, 0.5), 1.5);
  EXPECT_DOUBLE_EQ(quantile(values, 0.75), 4);
  EXPECT_DOUBLE_EQ(quantile(values, 1), 10);
  EXPECT_DOUBLE_EQ(quantile(std::vector<float>{1, 2}, 0.5), 1.5);
}

TEST(Quantile, OfOneValueIsIt) {
  for (const double share : {0.0, 0.5, 1.0}) EXPECT_EQ(quantile(std::vector<double>{7}, share), 7);
}

TEST(Quantile, OfNothingIsNotKnown) {
  EXPECT_TRUE(std::isnan(quantile(std::vector<double>{}, 0.5)));
}

}  // namespace
}  // namespace railfix::core
