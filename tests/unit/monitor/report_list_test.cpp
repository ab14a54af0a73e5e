#include "monitor/report_list.hpp"

#include <gmock/gmock.h>

#include "core/time.hpp"

namespace railfix::monitor {
namespace {

using ::testing::ElementsAre;

constexpr int64_t kNow = 4000;

msg::TrainPositionReport sent(int64_t sent_ns) {
  msg::TrainPositionReport report;
  report.sent_ns(sent_ns);
  return report;
}

std::vector<int64_t> times(const ReportList& reports) {
  std::vector<int64_t> times;
  for (const auto& message : reports.messages()) times.push_back(message.at("sent_ns"));
  return times;
}

// The one that stands by still has what it sent an hour ago, and a monitor that starts now gets both.
TEST(ReportList, WhatTheOtherOneHasKeptIsNotTheNewest) {
  ReportList reports;
  EXPECT_TRUE(reports.take(sent(3600), kNow));
  EXPECT_FALSE(reports.take(sent(6), kNow));
  EXPECT_TRUE(reports.take(sent(3606), kNow));
  EXPECT_FALSE(reports.take(sent(12), kNow));
  EXPECT_THAT(times(reports), ElementsAre(6, 12, 3600, 3606));
}

TEST(ReportList, TheOldestGo) {
  ReportList reports;
  for (int64_t i = 0; i < 100; ++i) EXPECT_TRUE(reports.take(sent(1000 + i), kNow));
  for (int64_t i = 0; i < 32; ++i) EXPECT_FALSE(reports.take(sent(i), kNow));
  EXPECT_EQ(times(reports).size(), 20U);
  EXPECT_EQ(times(reports).front(), 1080);
  EXPECT_TRUE(reports.take(sent(1099), kNow)) << "of two of one moment the one that comes later";
}

TEST(ReportList, AClockThatIsSetBackHidesNothing) {
  ReportList reports;
  const auto at = [](double s) { return core::to_ns(s); };
  reports.take(sent(at(3600)), at(3600));
  EXPECT_TRUE(reports.take(sent(at(10)), at(10.1)));
  EXPECT_TRUE(reports.take(sent(at(16)), at(16.1)));
  EXPECT_THAT(times(reports), ElementsAre(at(10), at(16)));
  ReportList ahead;  // a clock that is always so
  ahead.take(sent(at(60)), at(0));
  ahead.take(sent(at(66)), at(6));
  EXPECT_THAT(times(ahead), ElementsAre(at(60), at(66)));
}

}  // namespace
}  // namespace railfix::monitor
