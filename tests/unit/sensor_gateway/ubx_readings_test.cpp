#include "sensor_gateway/ubx_readings.hpp"

#include <gmock/gmock.h>

#include <cmath>
#include <numbers>

#include "core/time.hpp"
#include "sensor_gateway/imu_axes.hpp"
#include "support/ubx_frames.hpp"

namespace railfix::sensor_gateway {
namespace {

using test::ubx_imu;
using test::ubx_measurements;
using test::ubx_ticks;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

constexpr int64_t kMs = 1'000'000;

class UbxReadingsTest : public ::testing::Test {
 protected:
  std::vector<Sample> say(const std::string& bytes, int64_t arrival_ns = 0) {
    return readings_.read({reinterpret_cast<const uint8_t*>(bytes.data()), bytes.size()}, arrival_ns);
  }
  /// A message with the wheel's counter that comes when it is made.
  int64_t pulses_at(uint32_t tag_ms, uint32_t ticks, bool backward = false) {
    return pulses_at(tag_ms, ticks, backward, tag_ms * kMs);
  }
  int64_t pulses_at(uint32_t tag_ms, uint32_t ticks, bool backward, int64_t arrival_ns) {
    const auto got = say(ubx_measurements(tag_ms, {ubx_ticks(ticks, backward)}), arrival_ns);
    EXPECT_EQ(got.size(), 1U);
    return got.empty() ? 0 : std::get<dataset::WheelRow>(got[0]).pulses;
  }
  UbxReadings readings_{50};
};

TEST_F(UbxReadingsTest, AFrameOfTheDescription) {
  // UBX-ESF-MEAS with the time tag 1000 ms, one measurement, type 10: 258 ticks forward; checksum added up by hand.
  const std::string frame("\xB5\x62\x10\x02\x0C\x00\xE8\x03\x00\x00\x00\x08\x00\x00\x02\x01\x00\x0A\x1E\x14", 20);
  const auto got = say(frame);
  ASSERT_EQ(got.size(), 1U);
  EXPECT_EQ(std::get<dataset::WheelRow>(got[0]).stamp_ns, 1000 * kMs);
  EXPECT_EQ(frame, ubx_measurements(1000, {ubx_ticks(258, false)}));
}

TEST_F(UbxReadingsTest, ImuInUnitsAndSigns) {
  const auto got = say(ubx_measurements(7, ubx_imu({4096, -8192, 1}, {1024, -2048, 10045})));
  ASSERT_EQ(got.size(), 1U);
  const auto& row = std::get<dataset::ImuRow>(got[0]);
  constexpr double kDegree = std::numbers::pi / 180;
  EXPECT_EQ(row.stamp_ns, 7 * kMs);
  EXPECT_NEAR(row.rate_rps[0], kDegree, 1e-12);
  EXPECT_NEAR(row.rate_rps[1], -2 * kDegree, 1e-12);
  EXPECT_NEAR(row.rate_rps[2], kDegree / 4096, 1e-12);
  EXPECT_THAT(row.accel_mps2, ElementsAre(1.0, -2.0, 10045 / 1024.0));
}

TEST_F(UbxReadingsTest, RatesAndAccelerationsInTwoMessages) {
  EXPECT_THAT(say(ubx_measurements(100, {{14, 1}, {13, 2}, {5, 3}})), IsEmpty());
  EXPECT_EQ(say(ubx_measurements(105, {{16, 4}, {17, 5}, {18, 6}})).size(), 1U);
  EXPECT_THAT(say(ubx_measurements(200, {{14, 1}, {13, 2}, {5, 3}})), IsEmpty());
  EXPECT_THAT(say(ubx_measurements(300, {{16, 4}, {17, 5}, {18, 6}})), IsEmpty()) << "they are not of one time";
}

// Each is the number of its tick, 100 a second.
TEST_F(UbxReadingsTest, ALostMessageCostsItsSampleAndPairsNoOthers) {
  std::vector<int64_t> ticks;
  const auto hear = [&](const std::string& bytes) {
    for (const auto& sample : say(bytes)) {
      const auto& row = std::get<dataset::ImuRow>(sample);
      const int64_t tick = std::lround(row.accel_mps2[0] * 1024);
      ticks.push_back(tick);
      EXPECT_EQ(std::lround(row.rate_rps[0] * 180 / std::numbers::pi * 4096), tick);
      EXPECT_EQ(row.stamp_ns, tick * 10 * kMs);
    }
  };
  for (int tick = 100; tick < 110; ++tick) {
    const auto tag_ms = static_cast<uint32_t>(10 * tick);
    if (tick != 103) hear(ubx_measurements(tag_ms, {{14, tick}, {13, 0}, {5, 0}}));
    if (tick != 106) hear(ubx_measurements(tag_ms, {{16, tick}, {17, 0}, {18, 0}}));
  }
  EXPECT_THAT(ticks, ElementsAre(100, 101, 102, 104, 105, 107, 108, 109));
}

TEST_F(UbxReadingsTest, ALineThatIsJoinedBetweenTheTwoMessagesOfASampleFindsItsPairs) {
  std::vector<int64_t> apart;
  say(ubx_measurements(990, {{16, 99}, {17, 0}, {18, 0}}));
  for (int tick = 100; tick < 110; ++tick) {
    const auto tag_ms = static_cast<uint32_t>(10 * tick);
    say(ubx_measurements(tag_ms, {{14, tick}, {13, 0}, {5, 0}}));
    for (const auto& sample : say(ubx_measurements(tag_ms, {{16, tick}, {17, 0}, {18, 0}})))
      apart.push_back(tick - std::lround(std::get<dataset::ImuRow>(sample).accel_mps2[0] * 1024));
  }
  ASSERT_GE(apart.size(), 8U);
  EXPECT_THAT(apart, ::testing::Each(0));
}

// Whose accelerations are tagged 3 ms behind its rates; those of 105 come 9 ms too early.
TEST_F(UbxReadingsTest, AnOddTagCostsAFewSamplesAndNotAllBehindIt) {
  std::vector<int64_t> ticks;
  for (int tick = 100; tick < 115; ++tick) {
    const auto tag_ms = static_cast<uint32_t>(10 * tick - (tick == 105 ? 9 : 0));
    say(ubx_measurements(tag_ms, {{14, tick}, {13, 0}, {5, 0}}));
    for (const auto& sample : say(ubx_measurements(tag_ms + 3, {{16, tick}, {17, 0}, {18, 0}})))
      ticks.push_back(std::lround(std::get<dataset::ImuRow>(sample).accel_mps2[0] * 1024));
  }
  ASSERT_GE(ticks.size(), 10U);
  EXPECT_THAT(std::vector(ticks.begin(), ticks.begin() + 5), ElementsAre(100, 101, 102, 103, 104));
  EXPECT_THAT(std::vector(ticks.end() - 5, ticks.end()), ElementsAre(110, 111, 112, 113, 114));
}

TEST_F(UbxReadingsTest, AWheelForwardBackwardAndAroundItsCounter) {
  EXPECT_EQ(pulses_at(100, 0x7FFFF0), 0);
  EXPECT_EQ(pulses_at(200, 0x7FFFFF), 15);
  EXPECT_EQ(pulses_at(300, 4), 20) << "its counter of 23 bits began anew";
  EXPECT_EQ(pulses_at(400, 10, true), 14) << "it counts up backwards, too";
  EXPECT_EQ(pulses_at(500, 10), 14);
}

TEST_F(UbxReadingsTest, WhatAWheelCountedWhileTheLineWasCutIsKnownUnlessItWasSwitchedOff) {
  EXPECT_EQ(pulses_at(1000, 100), 0);
  readings_.connected();
  EXPECT_EQ(pulses_at(31000, 5100), 5000);
  readings_.connected();
  EXPECT_EQ(pulses_at(2000, 3, false, 41000 * kMs), 5000 + UbxReadings::kLeap) << "its time has begun anew";
  EXPECT_EQ(pulses_at(2100, 7, false, 41100 * kMs), 5004 + UbxReadings::kLeap);
  EXPECT_EQ(pulses_at(2200, 2, false, 41200 * kMs), 5004 + 2 * UbxReadings::kLeap) << "its counter has";
}

TEST_F(UbxReadingsTest, WhatWasHeldUpIsNoCountThatWasLost) {
  EXPECT_EQ(pulses_at(60'000, 100), 0);
  const int64_t held_ns = 62'000 * kMs;  // all that it said meanwhile is read at once
  for (uint32_t tag_ms = 60'050; tag_ms < 62'000; tag_ms += 50)
    EXPECT_EQ(pulses_at(tag_ms, tag_ms - 59'900, false, held_ns), tag_ms - 60'000);
  EXPECT_EQ(pulses_at(62'050, 2150), 2050);
}

TEST_F(UbxReadingsTest, AReceiverThatWasSwitchedOffRightAfterItBeganLostItsCount) {
  EXPECT_EQ(pulses_at(1000, 100), 0);
  readings_.connected();
  EXPECT_EQ(pulses_at(1500, 140, false, 3'601'000 * kMs), UbxReadings::kLeap);
}

// At 200 m/s and 50 pulses a metre half its counter is full after seven minutes.
TEST_F(UbxReadingsTest, ACounterThatMayHaveGoneRoundIsNotBelieved) {
  EXPECT_EQ(pulses_at(10'000, 100), 0);
  EXPECT_EQ(pulses_at(420'000, 300), 200);
  EXPECT_EQ(pulses_at(850'000, 500), 200 + UbxReadings::kLeap);
}

TEST_F(UbxReadingsTest, TimeTagsGoOnAroundTheirCounter) {
  const auto stamp_of = [this](uint32_t tag_ms) {
    return std::get<dataset::WheelRow>(say(ubx_measurements(tag_ms, {ubx_ticks(0, false)})).at(0)).stamp_ns;
  };
  const int64_t first_ns = stamp_of(0xFFFFFFF0);
  EXPECT_EQ(stamp_of(0x10) - first_ns, 32 * kMs);
  EXPECT_EQ(stamp_of(0x05) - first_ns, 21 * kMs) << "one that was set back";
  EXPECT_THAT(say(ubx_measurements(0x05, {ubx_ticks(0, false)})), IsEmpty()) << "told twice";
}

// Text of NMEA, half a frame, a frame that looks as if it began in the garbage, a wrong checksum, a length that is
// wrong.
TEST_F(UbxReadingsTest, GarbageCostsNoFrameThatIsWhole) {
  const std::string good = ubx_measurements(1, {ubx_ticks(1, false)});
  std::string spoilt = good;
  spoilt[10] = static_cast<char>(spoilt[10] ^ 1);
  const std::string text = "$GNRMC,,V*00\r\n" + good.substr(0, 9) + good + std::string("\xB5\x62\x10\x02\x20\x00", 6) +
                           ubx_measurements(2, {ubx_ticks(2, false)}) + spoilt + "\xB5" +
                           std::string("\xB5\x62\x10\x02\xFF\xFF", 6) + ubx_measurements(3, {ubx_ticks(3, false)}) +
                           test::ubx_frame(0x01, 0x07, std::string(92, '\0')) +
                           ubx_measurements(4, {ubx_ticks(4, false)});
  std::vector<int64_t> pulses;
  for (const char byte : text) {
    for (const auto& sample : say({byte})) pulses.push_back(std::get<dataset::WheelRow>(sample).pulses);
  }
  for (const auto& sample : say(std::string(64, '\0'))) pulses.push_back(std::get<dataset::WheelRow>(sample).pulses);
  EXPECT_THAT(pulses, ElementsAre(0, 1, 2, 3));
}

TEST_F(UbxReadingsTest, BrokenFramesAreCounted) {
  const std::string good = ubx_measurements(1, {ubx_ticks(1, false)});
  std::string spoilt = good;
  spoilt[10] = static_cast<char>(spoilt[10] ^ 1);
  say(good + spoilt + good + spoilt.substr(0, 12) + good);
  const Frames frames = readings_.take_frames();
  EXPECT_EQ(frames.whole, 3U);
  EXPECT_EQ(frames.broken, 2U);
  EXPECT_EQ(readings_.take_frames().broken, 0U) << "told once";
}

// One whose length became longer is not waited for: the frames behind it come as they are said.
TEST_F(UbxReadingsTest, AWrongLengthHoldsUpNoFrameBehindIt) {
  for (const int flipped : {0x02, 0x0E, 0x40}) {
    std::string longer = ubx_measurements(10, {ubx_ticks(10, false)});
    longer[4] = static_cast<char>(longer[4] ^ flipped);
    EXPECT_THAT(say(longer), IsEmpty());
    EXPECT_EQ(say(ubx_measurements(20, {ubx_ticks(20, false)})).size(), 1U);
    longer = test::ubx_frame(0x01, 0x07, std::string(92, '\0'));
    longer[5] = static_cast<char>(longer[5] ^ 0x08);
    EXPECT_THAT(say(longer), IsEmpty());
    EXPECT_EQ(say(ubx_measurements(30, {ubx_ticks(30, false)})).size(), 1U);
  }
  EXPECT_EQ(readings_.take_frames().broken, 6U);
}

TEST_F(UbxReadingsTest, MessagesThatAreTooShortAreNone) {
  EXPECT_THAT(say(test::ubx_frame(0x10, 0x02, "")), IsEmpty());
  std::string payload = test::little_endian(5, 4) + test::little_endian(3U << 11U, 2) + test::little_endian(0, 2);
  EXPECT_THAT(say(test::ubx_frame(0x10, 0x02, payload + test::little_endian(10U << 24U, 4))), IsEmpty());
  payload[5] = 0;  // does not say how many there are
  EXPECT_EQ(say(test::ubx_frame(0x10, 0x02, payload + test::little_endian(10U << 24U, 4))).size(), 1U);
}

TEST_F(UbxReadingsTest, SaysWhyNothingComes) {
  EXPECT_THAT(readings_.why_silent(), HasSubstr("power"));
  say("$GNRMC,,V*00\r\n");
  EXPECT_THAT(readings_.why_silent(), HasSubstr("live.baud"));
  say(test::ubx_frame(0x01, 0x07, std::string(92, '\0')));
  EXPECT_THAT(readings_.why_silent(), HasSubstr("UBX-ESF-MEAS"));
  say(ubx_measurements(1, {ubx_ticks(1, false)}));
  std::string spoilt = ubx_measurements(2, {ubx_ticks(2, false)});
  spoilt[10] = static_cast<char>(spoilt[10] ^ 1);
  say(spoilt + spoilt + spoilt);
  EXPECT_THAT(readings_.why_silent(), HasSubstr("only broken messages"));
}

TEST(ImuAxes, AreTurnedIntoThoseOfTheTrain) {
  dataset::ImuRow row{0, {1, 2, 3}, {4, 5, 6}};
  ImuAxes::parse("x y z").value().turn(row);
  EXPECT_THAT(row.rate_rps, ElementsAre(1, 2, 3));
  ImuAxes::parse("-y x z").value().turn(row);  // its x points left
  EXPECT_THAT(row.rate_rps, ElementsAre(-2, 1, 3));
  EXPECT_THAT(row.accel_mps2, ElementsAre(-5, 4, 6));
  for (const char* wrong : {"", "x y", "x y -z", "x x z", "y x z", "x y z x", "a y z", "--x y z", "xy z"}) {
    EXPECT_FALSE(ImuAxes::parse(wrong).ok()) << wrong;
  }
}

}  // namespace
}  // namespace railfix::sensor_gateway
