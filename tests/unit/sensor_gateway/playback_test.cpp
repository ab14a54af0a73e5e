#include "sensor_gateway/playback.hpp"

#include <gmock/gmock.h>

namespace railfix::sensor_gateway {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;

// IMU:   10 20 30 40
// Wheel:    20    40 41
// GNSS:  5        40
class PlaybackTest : public ::testing::Test {
 protected:
  PlaybackTest() : playback_(tables()) {}
  static dataset::Sensors tables() {
    dataset::Sensors sensors;
    for (const int64_t stamp : {10, 20, 30, 40}) sensors.imu.push_back({stamp, {}, {}});
    for (const int64_t stamp : {20, 40, 41}) sensors.wheel.push_back({stamp, 0});
    for (const int64_t stamp : {5, 40}) sensors.gnss.push_back({stamp, 0, 0, 0, 0, 1});
    return sensors;
  }
  std::vector<std::string> until(int64_t data_ns) {
    std::vector<std::string> played;
    playback_.play_until(data_ns, {[&](const auto& row) { played.push_back("i" + std::to_string(row.stamp_ns)); },
                                   [&](const auto& row) { played.push_back("w" + std::to_string(row.stamp_ns)); },
                                   [&](const auto& row) { played.push_back("g" + std::to_string(row.stamp_ns)); }});
    return played;
  }
  Playback playback_;
};

TEST_F(PlaybackTest, EverySampleOnceInTheOrderOfTime) {
  EXPECT_EQ(playback_.next_ns(), 5);
  EXPECT_THAT(until(4), IsEmpty());
  EXPECT_THAT(until(20), ElementsAre("g5", "i10", "i20", "w20"));
  EXPECT_THAT(until(20), IsEmpty());
  EXPECT_THAT(until(15), IsEmpty());
  EXPECT_EQ(playback_.next_ns(), 30);
  EXPECT_THAT(until(40), ElementsAre("i30", "i40", "w40", "g40"));
  EXPECT_THAT(until(1000), ElementsAre("w41"));
  EXPECT_EQ(playback_.next_ns(), std::nullopt);
}

TEST_F(PlaybackTest, GoesOnAndBack) {
  playback_.go_to(30);
  EXPECT_THAT(until(40), ElementsAre("i30", "i40", "w40", "g40"));
  playback_.go_to(20);
  EXPECT_THAT(until(30), ElementsAre("i20", "w20", "i30"));
  playback_.go_to(1000);
  EXPECT_EQ(playback_.next_ns(), std::nullopt);
}

TEST_F(PlaybackTest, NoTablesIsTheEndAtOnce) {
  playback_ = Playback({});
  EXPECT_EQ(playback_.next_ns(), std::nullopt);
  EXPECT_THAT(until(1000), IsEmpty());
}

}  // namespace
}  // namespace railfix::sensor_gateway
