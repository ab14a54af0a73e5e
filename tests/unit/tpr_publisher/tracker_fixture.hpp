// Follows a train over the balise groups of balise_map().
#pragma once

#include <gtest/gtest.h>

#include "tpr_publisher/balise_tracker.hpp"
#include "unit/tpr_publisher/balise_map.hpp"

namespace railfix::tpr_publisher::testing {

class TrackerFixture : public ::testing::Test {
 protected:
  void expect(uint32_t nid_lrbg, double foot_m) {
    ASSERT_TRUE(tracker.reference().has_value());
    EXPECT_EQ(tracker.reference()->group->nid_lrbg(), nid_lrbg);
    EXPECT_NEAR(tracker.reference()->foot_m, foot_m, 1e-9);
  }
  [[nodiscard]] uint32_t previous() const {
    return tracker.reference()->previous == nullptr ? 0 : tracker.reference()->previous->nid_lrbg();
  }
  BaliseTracker tracker{balise_map(), 5000};
};

}  // namespace railfix::tpr_publisher::testing
