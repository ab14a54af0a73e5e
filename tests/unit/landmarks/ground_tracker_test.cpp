#include "track_detector/ground_tracker.hpp"

#include <gtest/gtest.h>

namespace railfix::track_detector {
namespace {

/// How far ahead a thing that asks to be settled at 12 m is settled, seen from first_m on every half a metre.
double settled_ahead_m(double first_m) {
  GroundTracking tracking;
  tracking.reference_m = 9.5;
  tracking.usual_score = 0.36;
  GroundTracker tracker(tracking, 0.01);
  for (double way_m = 0; way_m < first_m - 5; way_m += 0.5) {
    GroundCandidate candidate{first_m - way_m, 0.7, 0.9};
    candidate.reference_m = 12;
    const auto& settled = tracker.follow({candidate}, way_m);
    if (!settled.empty()) return settled.front().place_m - way_m;
  }
  return 0;
}

TEST(GroundTracker, AThingIsSettledWhereItAsksToBeOrWhereAllAreIfItIsSeenTooLateForThat) {
  EXPECT_NEAR(settled_ahead_m(15.1), 11.6, 0.2);
  EXPECT_NEAR(settled_ahead_m(11.1), 9.1, 0.2);
}

}  // namespace
}  // namespace railfix::track_detector
