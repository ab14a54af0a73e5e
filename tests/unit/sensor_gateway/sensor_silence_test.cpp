#include "sensor_gateway/sensor_silence.hpp"

#include <gtest/gtest.h>

#include "core/time.hpp"

namespace railfix::sensor_gateway {
namespace {

constexpr size_t kImu = 0;
constexpr size_t kWheel = 1;
constexpr size_t kGnss = 2;

int64_t at_s(double s) {
  return core::to_ns(1000 + s);
}

/// IMU and wheel on one line, GNSS elsewhere.
SensorSilence silence() {
  return {{"ubx:/dev/ttyACM0", "ubx:/dev/ttyACM0", "gpsd://localhost:2947"}, 5, at_s(0)};
}

TEST(SensorSilence, IsOneOfASourceThatDelivers) {
  auto watched = silence();
  EXPECT_FALSE(watched.lacks(kWheel, at_s(6))) << "nothing has come at all, which the source says itself";
  watched.heard(kGnss, at_s(6));
  EXPECT_FALSE(watched.lacks(kWheel, at_s(6))) << "that is another source";
  watched.heard(kImu, at_s(6));
  EXPECT_TRUE(watched.lacks(kWheel, at_s(6)));
  EXPECT_FALSE(watched.lacks(kImu, at_s(6)));
  watched.heard(kWheel, at_s(7));
  EXPECT_FALSE(watched.lacks(kWheel, at_s(7)));
  EXPECT_FALSE(watched.lacks(kWheel, at_s(12)));
  watched.heard(kImu, at_s(12.5));
  EXPECT_TRUE(watched.lacks(kWheel, at_s(12.5)));
}

// The first sample behind it is that of one of its sensors; the other has been silent for as long as the line was.
TEST(SensorSilence, AnOutageOfTheWholeSourceIsNoneOfASensor) {
  auto watched = silence();
  watched.heard(kImu, at_s(1));
  watched.heard(kWheel, at_s(1));
  watched.gone("ubx:/dev/ttyACM0");
  EXPECT_FALSE(watched.lacks(kWheel, at_s(20)));
  watched.heard(kImu, at_s(30));
  watched.heard(kImu, at_s(34));
  EXPECT_FALSE(watched.lacks(kWheel, at_s(34)));
  watched.heard(kImu, at_s(36));
  EXPECT_TRUE(watched.lacks(kWheel, at_s(36))) << "now it has had its time";
}

TEST(SensorSilence, NoSensorIsNeverSilent) {
  SensorSilence watched({"", "", "gpsd://localhost:2947"}, 5, at_s(0));
  watched.heard(kGnss, at_s(9));
  EXPECT_FALSE(watched.lacks(kImu, at_s(9)));
  EXPECT_FALSE(watched.lacks(kGnss, at_s(99)));
}

}  // namespace
}  // namespace railfix::sensor_gateway
