#include "sensor_gateway/gnss_clock.hpp"

#include <gtest/gtest.h>

#include "core/time.hpp"

namespace railfix::sensor_gateway {
namespace {

using core::to_ns;
constexpr double kUtcS = 1'795'435'200;
const int64_t kLatencyNs = to_ns(0.15);

/// The stamp less the position's time of a receiver whose reports come after 0.15 to 0.35 s, when this computer's clock
/// is ahead by so much; of the last of so many reports, one a second.
std::optional<double> stamp_off_s(GnssClock& clock, double ahead_s, bool kept, int reports, double from_s = 0) {
  std::optional<double> off_s;
  for (int i = 0; i < reports; ++i) {
    const int64_t utc_ns = to_ns(kUtcS) + to_ns(from_s + i);
    const int64_t arrival_ns = utc_ns + to_ns(ahead_s) + kLatencyNs + to_ns(i % 3 * 0.1);
    const auto stamp_ns = clock.stamp_ns(utc_ns, {arrival_ns, arrival_ns - to_ns(ahead_s)}, kept);
    off_s = stamp_ns ? std::optional(core::seconds(*stamp_ns - utc_ns)) : std::nullopt;
  }
  return off_s;
}

TEST(GnssClock, TheReceiversTimeWhereThisComputersClockIsKept) {
  GnssClock clock(kLatencyNs);
  EXPECT_EQ(stamp_off_s(clock, 0, true, 1), 0.0);
  EXPECT_EQ(stamp_off_s(clock, 0.02, true, 20, 1), 0.0);
  EXPECT_EQ(clock.contradiction_s(), std::nullopt);
}

TEST(GnssClock, TheArrivalWhereNobodyKeepsIt) {
  for (const double ahead_s : {-7200.0, -0.3, 0.0, 0.4, 600.0}) {
    GnssClock clock(kLatencyNs);
    EXPECT_EQ(stamp_off_s(clock, ahead_s, false, 3), std::nullopt) << "one report may have been delayed";
    const auto off_s = stamp_off_s(clock, ahead_s, false, 60, 3);
    ASSERT_TRUE(off_s);
    EXPECT_NEAR(*off_s, ahead_s, 0.02);
  }
}

// A link that is cut for three seconds brings their reports together.
TEST(GnssClock, ReportsThatWereHeldBackHaveTheTimeOfTheirPosition) {
  GnssClock clock(kLatencyNs);
  (void)stamp_off_s(clock, 0.4, false, 60);
  const int64_t together_ns = to_ns(kUtcS) + to_ns(63.4) + kLatencyNs;
  for (int i = 60; i < 64; ++i) {
    const int64_t utc_ns = to_ns(kUtcS) + to_ns(i);
    const auto stamp_ns = clock.stamp_ns(utc_ns, {together_ns, together_ns - to_ns(0.4)}, false);
    ASSERT_TRUE(stamp_ns);
    EXPECT_NEAR(core::seconds(*stamp_ns - utc_ns), 0.4, 0.02) << i;
  }
}

TEST(GnssClock, TwoClocksThatContradictAreNotBelieved) {
  for (const double ahead_s : {-18.0, 12.0}) {
    GnssClock clock(kLatencyNs);
    EXPECT_EQ(stamp_off_s(clock, ahead_s, true, 3), std::nullopt);
    EXPECT_EQ(clock.contradiction_s(), std::nullopt) << "one report may have been delayed";
    EXPECT_EQ(stamp_off_s(clock, ahead_s, true, 3, 3), std::nullopt);
    ASSERT_TRUE(clock.contradiction_s());
    EXPECT_NEAR(*clock.contradiction_s(), ahead_s, 0.1);
    EXPECT_EQ(stamp_off_s(clock, 0, true, 5, 6), 0.0) << "set right";
    EXPECT_EQ(clock.contradiction_s(), std::nullopt);
  }
}

TEST(GnssClock, AContradictionIsOfTheConnectionThatShowedIt) {
  GnssClock clock(kLatencyNs);
  EXPECT_FALSE(stamp_off_s(clock, 3, true, 6));
  ASSERT_TRUE(clock.contradiction_s());
  clock.connected();
  EXPECT_FALSE(clock.contradiction_s());
  EXPECT_EQ(stamp_off_s(clock, 0, true, 40, 100), 0.0) << "the receiver has learnt the leap seconds";
}

}  // namespace
}  // namespace railfix::sensor_gateway
