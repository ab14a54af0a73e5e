#include "sensor_gateway/frame_watch.hpp"

#include <gmock/gmock.h>

#include "core/time.hpp"

namespace railfix::sensor_gateway {
namespace {

using ::testing::HasSubstr;
using ::testing::IsEmpty;

TEST(FrameWatch, ThreeBrokenMessagesInTenSecondsAreSaidUntilTheyAreOld) {
  FrameWatch watch;
  for (int i = 0; i < 100; ++i) watch.add({10, i == 50 || i == 60 ? 1U : 0U}, i * core::kNsPerSecond / 10);
  EXPECT_THAT(watch.trouble(10 * core::kNsPerSecond), IsEmpty()) << "two are what was cut";
  watch.add({7, 1}, 11 * core::kNsPerSecond);
  EXPECT_THAT(watch.trouble(11 * core::kNsPerSecond), HasSubstr("(3 of the last 910 are lost); check its cable"));
  EXPECT_THAT(watch.trouble(15 * core::kNsPerSecond + 1), IsEmpty());
}

}  // namespace
}  // namespace railfix::sensor_gateway
