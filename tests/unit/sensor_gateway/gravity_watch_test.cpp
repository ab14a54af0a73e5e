#include "sensor_gateway/gravity_watch.hpp"

#include <gmock/gmock.h>

#include <cmath>

#include "core/time.hpp"

namespace railfix::sensor_gateway {
namespace {

using ::testing::HasSubstr;
using ::testing::IsEmpty;

/// What it says at the end of so long with this specific force, 50 samples a second.
std::string after(GravityWatch& watch, double from_s, double seconds, double forward, double left, double up) {
  for (int i = 0; i < std::lround(seconds * 50); ++i)
    watch.add({core::to_ns(1000 + from_s + i * 0.02), {0, 0, 0}, {forward, left, up}});
  return watch.trouble();
}
std::string after(double forward, double left, double up) {
  GravityWatch watch;
  return after(watch, 0, 60, forward, left, up);
}

TEST(GravityWatch, ATrainMayTilt) {
  EXPECT_THAT(after(0, 0, 9.81), IsEmpty());
  EXPECT_THAT(after(1.4, -1.6, 9.6), IsEmpty()) << "long braking in a canted curve";
}

TEST(GravityWatch, AnImuThatSitsOtherwiseIsToldWithTheAxis) {
  EXPECT_THAT(after(9.81, 0.2, 0.1), HasSubstr("called forward, so its samples are not used; correct live.imu_axes"));
  EXPECT_THAT(after(0.3, -9.81, 0.1), HasSubstr("called left, the other way round"));
  EXPECT_THAT(after(0, 0, -9.81), HasSubstr("called up, the other way round"));
  EXPECT_THAT(after(0.01, 0.01, 0.02), HasSubstr("feels no gravity"));
}

TEST(GravityWatch, OtherUnitsAreTold) {
  EXPECT_THAT(after(0, 0.02, 1.0), HasSubstr("feels gravity as 1.0 and not as 9.8 m/s2"));
  EXPECT_THAT(after(0, 0.2, 32.2), HasSubstr("feels gravity as 32.2 and not as 9.8 m/s2"));
  GravityWatch recorded;
  static_cast<void>(after(recorded, 0, 60, 0, 0, -9.81));
  EXPECT_THAT(recorded.trouble_of_recording(), HasSubstr("called up, the other way round; the recording's IMU must"));
}

TEST(GravityWatch, ItIsKnownToBeRightAfterASecond) {
  GravityWatch watch;
  static_cast<void>(after(watch, 0, 0.9, 0, 0, 9.81));
  EXPECT_FALSE(watch.agrees());
  static_cast<void>(after(watch, 0.9, 0.2, 0, 0, 9.81));
  EXPECT_TRUE(watch.agrees());
  static_cast<void>(after(watch, 10, 0.5, 0, 0, 9.81));
  EXPECT_FALSE(watch.agrees()) << "behind a gap it may be another one";
  static_cast<void>(after(watch, 10.5, 1, 0, 0, 9.81));
  EXPECT_TRUE(watch.agrees());

  for (const double gravity_mps2 : {9.81, -9.81, 1.0}) {
    GravityWatch wrong;
    EXPECT_THAT(after(wrong, 0, 9, 0.1, gravity_mps2, 0.1), IsEmpty());
    EXPECT_FALSE(wrong.agrees()) << gravity_mps2;
  }
  GravityWatch shaken;
  static_cast<void>(after(shaken, 0, 0.1, 30, 0, 0));
  static_cast<void>(after(shaken, 0.1, 2, 0, 0, 9.81));
  EXPECT_TRUE(shaken.agrees()) << "where it is met first is no matter";
}

TEST(GravityWatch, NothingIsSaidBeforeTenSecondsAndAShockIsNone) {
  GravityWatch watch;
  EXPECT_THAT(after(watch, 0, 9, 9.81, 0, 0), IsEmpty());
  EXPECT_THAT(after(watch, 60, 9, 9.81, 0, 0), IsEmpty()) << "behind a gap it begins anew";
  EXPECT_THAT(after(watch, 69, 3, 9.81, 0, 0), HasSubstr("forward"));
  for (int i = 0; i < 10; ++i)
    EXPECT_THAT(after(watch, 80 + 10 * i, 8, 9.81, 0, 0), HasSubstr("forward")) << "no gap turns an IMU round";
  EXPECT_THAT(after(watch, 200, 15, 0, 0, 9.81), IsEmpty()) << "somebody has";
  GravityWatch shaken;
  EXPECT_THAT(after(shaken, 0, 20, 0, 0, 9.81), IsEmpty());
  EXPECT_THAT(after(shaken, 20, 1, 30, 0, 0), IsEmpty());
}

}  // namespace
}  // namespace railfix::sensor_gateway
