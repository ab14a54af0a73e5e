#include "core/device_clock.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "core/random.hpp"
#include "core/time.hpp"

namespace railfix::core {
namespace {

// A device clock that is far off and 40 ppm fast; messages take 3 ms, one in five up to 20 ms more.
TEST(DeviceClock, FollowsOffsetAndDriftWhileMessagesArriveLate) {
  Random random(5);
  DeviceClock clock;
  int64_t last_ns = 0;
  for (int i = 0; i < 60 * 60; ++i) {  // a minute
    const double true_s = i / 60.0;
    const auto arrival_ns = to_ns(1000 + true_s + 0.003 + (random.uniform(0, 1) < 0.2 ? random.uniform(0, 0.02) : 0));
    const int64_t host_ns = clock.host_ns(to_ns(5 + true_s * (1 + 40e-6)), {arrival_ns, arrival_ns});
    EXPECT_GT(host_ns, last_ns);
    last_ns = host_ns;
    const double error_s = seconds(host_ns - to_ns(1000 + true_s + 0.003));
    if (i > 5) {
      EXPECT_LT(std::abs(error_s), true_s < 12 ? 600e-6 : 100e-6) << true_s;
    }
  }
}

// Wall time is ahead of monotonic time by so much, and a message takes 5 ms.
constexpr double kWallS = 1.7e9;
HostTime arrival(double monotonic_s, double set_s = 0) {
  return {to_ns(kWallS + set_s) + to_ns(monotonic_s), to_ns(monotonic_s)};
}

TEST(DeviceClock, BeginsAnewWhenTheDeviceDoes) {
  DeviceClock clock;
  (void)clock.host_ns(to_ns(100.0), arrival(1000));
  EXPECT_EQ(clock.host_ns(to_ns(1.0), arrival(1010)), arrival(1010).wall_ns);
  EXPECT_EQ(clock.host_ns(to_ns(500.0), arrival(1011)), arrival(1011).wall_ns) << "no message comes before its time";
}

// The largest error of the stamps where the messages of some seconds come all at their end.
double worst_behind_a_stall_s(double period_s, double stall_s) {
  constexpr double kStallAtS = 30;
  DeviceClock clock;
  double worst_s = 0;
  for (double t = 0; t < 60; t += period_s) {
    const bool stalled = t >= kStallAtS && t < kStallAtS + stall_s;
    const auto stamp_ns = clock.host_ns(to_ns(t), arrival((stalled ? kStallAtS + stall_s : t) + 0.005));
    worst_s = std::max(worst_s, std::abs(seconds(stamp_ns - arrival(t + 0.005).wall_ns)));
  }
  return worst_s;
}

TEST(DeviceClock, WhatALinkHeldBackHasTheStampsOfBefore) {
  for (const double stall_s : {0.9, 1.2, 3.0, 60.0}) {
    EXPECT_LT(worst_behind_a_stall_s(0.01, stall_s), 1e-3) << stall_s;
    EXPECT_LT(worst_behind_a_stall_s(1.0, stall_s), 1e-3) << stall_s;
  }
}

TEST(DeviceClock, FollowsTheHostsClockAtOnceWhereThatIsSet) {
  for (const double set_s : {-3600.0, -0.4, 0.4, 5.0, 1e6}) {
    DeviceClock clock;
    for (int i = 0; i < 100; ++i) (void)clock.host_ns(to_ns(i * 0.1), arrival(i * 0.1 + 0.005));
    for (int i = 100; i < 200; ++i) {
      const double t = i * 0.1;
      EXPECT_NEAR(seconds(clock.host_ns(to_ns(t), arrival(t + 0.005, set_s)) - arrival(t + 0.005, set_s).wall_ns), 0,
                  1e-6)
          << set_s;
    }
  }
}

// A device that was off for a while and goes on counting where it was.
TEST(DeviceClock, BelievesADeviceThatStaysBehind) {
  DeviceClock clock;
  for (int i = 0; i < 100; ++i) (void)clock.host_ns(to_ns(i * 0.1), arrival(i * 0.1));
  double error_s = 0;
  for (int i = 100; i < 140; ++i)
    error_s = seconds(clock.host_ns(to_ns(i * 0.1), arrival(20 + i * 0.1)) - arrival(20 + i * 0.1).wall_ns);
  EXPECT_NEAR(error_s, 0, 1e-6);
}

}  // namespace
}  // namespace railfix::core
