#include "sensor_gateway/gpsd_reports.hpp"

#include <gmock/gmock.h>

#include <cmath>

#include "core/time.hpp"

namespace railfix::sensor_gateway {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

constexpr int64_t kNoonNs = 1'795'435'200'000'000'000;  // 2026-11-23T12:00:00Z
const std::string kOne =
    R"({"class":"DEVICES","devices":[{"class":"DEVICE","path":"/dev/ttyACM0"},{"class":"DEVICE","path":"/dev/pps0"}]})";
const std::string kTwo = R"({"class":"DEVICES","devices":[{"path":"/dev/ttyACM0"},{"path":"/dev/ttyACM1"}]})";

std::string sky(const std::string& hdop, const std::string& device = "/dev/ttyACM0") {
  return R"({"class":"SKY","device":")" + device + R"(","hdop":)" + hdop + "}";
}
std::string tpv(const std::string& time, const std::string& more, const std::string& device = "/dev/ttyACM0") {
  return R"({"class":"TPV","device":")" + device + R"(","time":"2026-11-23T12:)" + time +
         R"(Z","lat":46.9,"lon":7.4,"altMSL":545.4,)" + more + "}";
}

class GpsdReportsTest : public ::testing::Test {
 protected:
  std::vector<GpsdReport> say(const std::string& line) {
    const std::string text = line + "\r\n";
    return reports_.read({reinterpret_cast<const uint8_t*>(text.data()), text.size()}, now_ns_);
  }
  int fix_of(const std::string& more) {
    const auto got = say(tpv("00:0" + std::to_string(seconds_++) + ".000", more));
    return got.size() == 1 ? got[0].row.fix : -1;
  }
  int64_t now_ns_ = kNoonNs;
  int seconds_ = 0;
  GpsdReports reports_{""};
};

TEST_F(GpsdReportsTest, APositionWithTheQualityBeforeIt) {
  EXPECT_THAT(say(kOne), IsEmpty());
  EXPECT_THAT(say(tpv("00:00.000", R"("mode":3)")), IsEmpty()) << "nothing is known of its quality";
  EXPECT_THAT(reports_.why_silent(), HasSubstr("without HDOP"));
  EXPECT_THAT(say(sky("1.3")), IsEmpty());
  const auto got = say(tpv("00:01.250", R"("mode":3)"));
  ASSERT_EQ(got.size(), 1U);
  EXPECT_EQ(got[0].utc_ns, kNoonNs + 1'250'000'000);
  EXPECT_EQ(got[0].row.lat_deg, 46.9);
  EXPECT_EQ(got[0].row.lon_deg, 7.4);
  EXPECT_EQ(got[0].row.alt_m, 545.4);
  EXPECT_EQ(got[0].row.hdop, 1.3);
  EXPECT_EQ(got[0].row.fix, 1);
}

TEST_F(GpsdReportsTest, WhatSatellitesDidNotMeasureIsNoPosition) {
  say(tpv("00:00.000", R"("mode":1)"));
  say(sky("1"));
  seconds_ = 1;
  EXPECT_EQ(fix_of(R"("mode":0)"), 0);
  EXPECT_EQ(fix_of(R"("mode":1)"), 0);
  EXPECT_EQ(fix_of(R"("mode":2)"), 1);
  EXPECT_EQ(fix_of(R"("mode":3,"status":2)"), 1);
  EXPECT_EQ(fix_of(R"("mode":3,"status":3)"), 4);
  EXPECT_EQ(fix_of(R"("mode":3,"status":4)"), 5);
  EXPECT_EQ(fix_of(R"("mode":3,"status":5)"), 0) << "dead reckoning";
  EXPECT_EQ(fix_of(R"("mode":3,"status":8)"), 0) << "simulated";
  const auto none = say(R"({"class":"TPV","device":"/dev/ttyACM0","mode":1})");
  ASSERT_EQ(none.size(), 1U);
  EXPECT_EQ(none[0].utc_ns, std::nullopt);
  EXPECT_TRUE(std::isnan(none[0].row.lat_deg) && std::isnan(none[0].row.hdop));
}

// A receiver with sensors, whose place IMU and wheel are in already.
TEST_F(GpsdReportsTest, APlaceWithDeadReckoningInItIsNoneAndSaysWhatToSwitchOff) {
  say(tpv("00:00.000", R"("mode":1)"));
  say(sky("1"));
  seconds_ = 1;
  EXPECT_EQ(fix_of(R"("mode":3,"status":6)"), 0);
  EXPECT_THAT(reports_.complaint(), AllOf(HasSubstr("status 6"), HasSubstr("switch the receiver's sensor fusion off")));
  EXPECT_EQ(fix_of(R"("mode":3,"status":1)"), 1);
  EXPECT_THAT(reports_.complaint(), IsEmpty());
}

TEST_F(GpsdReportsTest, APlaceWithoutItsTimeIsSaid) {
  say(kOne);
  say(tpv("00:00.000", R"("mode":1)"));
  say(sky("1"));
  EXPECT_THAT(say(R"({"class":"TPV","device":"/dev/ttyACM0","mode":3,"lat":46.9,"lon":7.4})"), IsEmpty());
  EXPECT_THAT(reports_.why_silent(), AllOf(HasSubstr("without their time and date"), HasSubstr("RMC or ZDA")));
  EXPECT_EQ(say(tpv("00:01.000", R"("mode":3)")).size(), 1U);
  EXPECT_THAT(reports_.why_silent(), HasSubstr("its cable"));
}

TEST_F(GpsdReportsTest, EachEpochOnceAndNoOldOnes) {
  say(tpv("00:00.000", R"("mode":1)"));
  say(sky("1"));
  EXPECT_EQ(say(tpv("00:05.000", R"("mode":3)")).size(), 1U);
  EXPECT_THAT(say(tpv("00:05.000", R"("mode":3)")), IsEmpty());
  EXPECT_THAT(say(tpv("00:04.000", R"("mode":3)")), IsEmpty());
  EXPECT_EQ(say(tpv("00:05.100", R"("mode":3)")).size(), 1U);
  EXPECT_EQ(
      say(R"({"class":"TPV","device":"/dev/ttyACM0","time":"2007-04-08T12:00:00Z","mode":3,"lat":1,"lon":2})").size(),
      1U)
      << "a receiver whose clock was set";
}

TEST_F(GpsdReportsTest, AQualityThatIsNotToldAnyMoreIsNotBelieved) {
  say(tpv("00:00.000", R"("mode":1)"));
  say(sky("1"));
  now_ns_ += 9 * core::kNsPerSecond;
  EXPECT_EQ(say(tpv("00:09.000", R"("mode":3)")).size(), 1U);
  now_ns_ += 2 * core::kNsPerSecond;
  EXPECT_THAT(say(tpv("00:11.000", R"("mode":3)")), IsEmpty());
}

// A receiver that tells its quality more rarely than a silent connection is made anew.
TEST_F(GpsdReportsTest, AQualityIsStillKnownOnTheNextConnection) {
  say(tpv("00:00.000", R"("mode":1)"));
  say(sky("1.3"));
  now_ns_ += 3 * core::kNsPerSecond;
  reports_.connected();
  EXPECT_EQ(say(tpv("00:03.000", R"("mode":3)")).size(), 1U);
  reports_.connected();
  EXPECT_THAT(say(tpv("00:04.000", R"("mode":3)", "/dev/ttyACM1")), IsEmpty()) << "of another receiver";
}

TEST_F(GpsdReportsTest, OneOfSeveralReceiversIsNamed) {
  say(kTwo);
  EXPECT_THAT(reports_.trouble(), AllOf(HasSubstr("/dev/ttyACM0, /dev/ttyACM1"), HasSubstr("name one")));
  EXPECT_THAT(say(tpv("00:00.000", R"("mode":1)")), IsEmpty());

  reports_ = GpsdReports("/dev/ttyACM1");
  say(kTwo);
  EXPECT_THAT(reports_.trouble(), IsEmpty());
  say(sky("9", "/dev/ttyACM0"));
  say(sky("2", "/dev/ttyACM1"));
  EXPECT_THAT(say(tpv("00:01.000", R"("mode":3)", "/dev/ttyACM0")), IsEmpty());
  const auto got = say(tpv("00:01.000", R"("mode":3)", "/dev/ttyACM1"));
  ASSERT_EQ(got.size(), 1U);
  EXPECT_EQ(got[0].row.hdop, 2);

  reports_ = GpsdReports("/dev/ttyUSB7");
  say(kTwo);
  EXPECT_THAT(reports_.trouble(), HasSubstr("has no receiver /dev/ttyUSB7, only /dev/ttyACM0, /dev/ttyACM1"));
  reports_.connected();
  EXPECT_THAT(reports_.trouble(), IsEmpty());
}

TEST_F(GpsdReportsTest, BytesInAnyPiecesAndWhatIsNoReport) {
  const std::string text = "{\"class\":\n" + tpv("00:00.000", R"("mode":1)") + "\n" + sky("1") + "\n[]\nnull\n" +
                           tpv("00:01.000", R"("mode":"three")") + "\n" + std::string(70000, 'x') + "\n" +
                           tpv("00:02.000", R"("mode":3)") + "\n";
  std::vector<int> fixes;
  for (const char byte : text) {
    for (const auto& report : reports_.read({reinterpret_cast<const uint8_t*>(&byte), 1}, now_ns_))
      fixes.push_back(report.row.fix);
  }
  EXPECT_THAT(fixes, ::testing::ElementsAre(0, 0, 1));
  EXPECT_THAT(say(R"({"class":"TPV","device":"/dev/ttyACM0","time":"2026-13-41T12:00:03Z","lat":46,"lon":7,"mode":3})"),
              IsEmpty());
  EXPECT_THAT(
      say(R"({"class":"TPV","device":"/dev/ttyACM0","time":"2026-11-23T12:00:04Z","lat":146,"lon":7,"mode":3})"),
      IsEmpty());
  const std::string deep = std::string(32'000, '[') + std::string(32'000, ']');
  EXPECT_THAT(say(R"({"class":"DEVICES","devices":[{"path":"/dev/ttyACM0","activated":)" + deep + "}]}"), IsEmpty());
  EXPECT_THAT(reports_.why_silent(), HasSubstr("has no receiver")) << "such a line is not read";
}

}  // namespace
}  // namespace railfix::sensor_gateway
