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
    const int64_t host_ns = clock.host_ns(to_ns(5 + true_s * (1 + 40e-6)), arrival_ns);
    EXPECT_GT(host_ns, last_ns);
    last_ns = host_ns;
    const double error_s = seconds(host_ns - to_ns(1000 + true_s + 0.003));
    if (i > 5) {
      EXPECT_LT(std::abs(error_s), true_s < 12 ? 600e-6 : 100e-6) << true_s;
    }
  }
  EXPECT_NEAR(clock.drift_ppm(), -40, 5);
}

TEST(DeviceClock, BeginsAnewWhenTheDeviceDoes) {
  DeviceClock clock;
  (void)clock.host_ns(to_ns(100.0), to_ns(1000.0));
  EXPECT_EQ(clock.host_ns(to_ns(1.0), to_ns(1010.0)), to_ns(1010.0));
  EXPECT_EQ(clock.host_ns(to_ns(500.0), to_ns(1011.0)), to_ns(1011.0));
}

}  // namespace
}  // namespace railfix::core
