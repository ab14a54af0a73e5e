// A place that one fusion hands to the next: it must hold the train, whatever that has done meanwhile.
#include "fusion/handover.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "core/time.hpp"
#include "unit/tpr_publisher/balise_map.hpp"

namespace railfix::fusion {
namespace {

using tpr_publisher::testing::balise_map;  // edge 1, a switch at its end

constexpr double kFactor = 4;

KnownPlace at(double offset_m, double speed_mps, track::Direction direction = track::Direction::forward) {
  KnownPlace known;
  known.stamp_ns = core::kNsPerSecond;
  known.position = {1, offset_m, direction};
  known.speed_mps = speed_mps;
  known.over_m = 2;
  known.under_m = 1;
  known.track_probability = 0.999;
  return known;
}
int64_t after(double seconds) {
  return core::kNsPerSecond + core::to_ns(seconds);
}

TEST(Handover, AtOnceItIsTheSamePlaceWithTheSameInterval) {
  const auto place = place_at(balise_map(), at(300, 20), after(0), kFactor);
  ASSERT_TRUE(place);
  EXPECT_EQ(place->edge, 1U);
  EXPECT_DOUBLE_EQ(place->offset_m, 300);
  EXPECT_DOUBLE_EQ(place->sigma_m * kFactor, 2);
  EXPECT_EQ(place->kind, FixKind::network);
  EXPECT_DOUBLE_EQ(place->probability, 0.999);
}

TEST(Handover, LaterItHoldsATrainThatHasBrakedOrSpedUp) {
  for (const auto direction : {track::Direction::forward, track::Direction::reverse}) {
    for (const double seconds : {0.5, 1.0, 3.0, 6.0}) {
      const auto known = at(500, 20, direction);
      const auto place = place_at(balise_map(), known, after(seconds), kFactor);
      ASSERT_TRUE(place) << seconds;
      EXPECT_EQ(place->direction, direction);
      const double sign = direction == track::Direction::forward ? 1 : -1;
      for (const double acceleration : {-2.5, 0.0, 2.5}) {
        const double moved_m = 20 * seconds + acceleration / 2 * seconds * seconds;
        for (const double error_m : {-2.0, 1.0})  // where it was known to be
          EXPECT_LE(std::abs(500 + sign * (moved_m + error_m) - place->offset_m), place->sigma_m * kFactor);
      }
    }
  }
}

TEST(Handover, NotWhereASwitchMayHaveLedTheTrainElsewhere) {
  EXPECT_TRUE(place_at(balise_map(), at(900, 20), after(1), kFactor));
  EXPECT_FALSE(place_at(balise_map(), at(900, 20), after(4.7), kFactor))
      << "the switch is at 1000 m, the interval reaches it";
  EXPECT_FALSE(place_at(balise_map(), at(990, 20), after(1), kFactor));
  EXPECT_TRUE(place_at(balise_map(), at(900, -20), after(4.7), kFactor)) << "it runs away from it";
}

// After an update of its map one fusion may number the edges otherwise than the other.
TEST(Handover, NotWhereItIsOfAnotherMap) {
  const auto pose = balise_map()->edge(1)->alignment.at(300).pose;
  KnownPlace known = at(300, 20);
  known.pose = pose;
  known.pose.northing_m += 0.5;
  EXPECT_TRUE(place_at(balise_map(), known, after(1), kFactor));
  known.pose.northing_m += 3900;
  EXPECT_FALSE(place_at(balise_map(), known, after(1), kFactor));
}

TEST(Handover, NotWhenItIsOldOrTheSpeedIsNotKnown) {
  EXPECT_FALSE(place_at(balise_map(), at(300, 0), after(31), kFactor));
  EXPECT_FALSE(place_at(balise_map(), at(300, std::nan("")), after(1), kFactor));
}

}  // namespace
}  // namespace railfix::fusion
