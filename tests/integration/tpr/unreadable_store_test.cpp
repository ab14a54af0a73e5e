// A disk whose files cannot be read for a while (EIO): the C library's calls by which SQLite and streams read.
#include <sys/stat.h>
#include <sys/syscall.h>

#include <atomic>
#include <cerrno>

#include "integration/tpr/ground_link_fixture.hpp"

namespace {

std::atomic<bool> disk_fails = false;
std::atomic<int> reads_failed = 0;

bool fails(int file) {
  struct stat what {};
  if (!disk_fails || fstat(file, &what) != 0 || !S_ISREG(what.st_mode)) return false;
  ++reads_failed;
  errno = EIO;
  return true;
}

}  // namespace

extern "C" ssize_t pread64(int file, void* into, size_t bytes, off64_t at) {
  return fails(file) ? -1 : syscall(SYS_pread64, file, into, bytes, at);
}
extern "C" ssize_t read(int file, void* into, size_t bytes) {
  return fails(file) ? -1 : syscall(SYS_read, file, into, bytes);
}

namespace railfix {
namespace {

class UnreadableStore : public GroundLinkTest {
 protected:
  void SetUp() override {
    GroundLinkTest::SetUp();
    if (IsSkipped()) return;
    ASSERT_TRUE(broker_.start());
    ASSERT_TRUE(ground_.emplace(broker_.address(), train_).subscribed());
    broker_.stop();
    settings_ = link_settings(broker_.address());
    auto long_report = report(1);
    long_report.message.assign(6000, 0x88);
    tpr_publisher::GroundLink link(settings_);
    for (; long_report.stamp_ns <= static_cast<int64_t>(kReports); ++long_report.stamp_ns) link.send(long_report);
  }
  void TearDown() override { disk_fails = false; }

  static constexpr uint64_t kReports = 1000;  // more than SQLite keeps in memory
  test::Broker broker_{file("broker")};
  std::optional<Ground> ground_;
  tpr_publisher::GroundLinkSettings settings_;
};

TEST_F(UnreadableStore, ReportsWaitUntilTheyCanBeReadAndNoneIsLost) {
  tpr_publisher::GroundLink link(settings_);
  disk_fails = true;
  ASSERT_TRUE(broker_.start());
  const bool told = wait_for([&] { return says(link, "Stored reports wait until they can be read again."); });
  disk_fails = false;
  ASSERT_TRUE(told) << link.trouble();
  EXPECT_GT(reads_failed, 0);
  ASSERT_TRUE(wait_for([&] { return ground_->count() >= kReports; })) << link.trouble();
  const auto arrived = ground_->reports();
  for (uint64_t i = 0; i < kReports; ++i) {
    ASSERT_EQ(arrived[i].sequence, i + 1);
    ASSERT_EQ(arrived[i].stamp_ns, static_cast<int64_t>(i + 1));
  }
  EXPECT_TRUE(wait_for([&] { return link.trouble().empty(); })) << link.trouble();
}

TEST_F(UnreadableStore, WhatStaysUnreadableHoldsNewerReportsUpOnlyForAWhile) {
  settings_.read_patience = std::chrono::seconds(1);
  uint64_t lost = 0;
  {
    tpr_publisher::GroundLink link(settings_);
    disk_fails = true;
    ASSERT_TRUE(broker_.start());
    ASSERT_TRUE(wait_for([&] { return says(link, "reports for the ground are lost"); })) << link.trouble();
    disk_fails = false;
    link.send(report(kReports + 1));
    ASSERT_TRUE(wait_for([&] {
      const auto reports = ground_->reports();
      return !reports.empty() && reports.back().stamp_ns == static_cast<int64_t>(kReports + 1);
    })) << link.trouble();
    lost = kReports + 1 - ground_->count();
    EXPECT_TRUE(wait_for([&] { return says(link, std::to_string(lost) + " reports"); })) << link.trouble();
  }
  EXPECT_GT(lost, 0U);
  const tpr_publisher::GroundLink again(settings_);
  EXPECT_TRUE(wait_for([&] { return ground_->count() == kReports + 1; })) << "given up, not thrown away";
}

TEST_F(UnreadableStore, WhatLiesInAStoreThatCannotBeOpenedAtTheStartGoesBeforeWhatIsNew) {
  disk_fails = true;
  tpr_publisher::GroundLink link(settings_);
  ASSERT_TRUE(broker_.start());
  link.send(report(kReports + 1));
  ASSERT_TRUE(wait_for([&] {
    return link.connected() && says(link, "Reports wait up to 60 s for those that may lie in it: 1 wait in memory");
  })) << link.trouble();
  EXPECT_FALSE(link.stores());
  EXPECT_EQ(ground_->count(), 0U);
  disk_fails = false;
  ASSERT_TRUE(wait_for([&] { return ground_->count() == kReports + 1; })) << link.trouble();
  const auto arrived = ground_->reports();
  for (uint64_t i = 0; i <= kReports; ++i) ASSERT_EQ(arrived[i].stamp_ns, static_cast<int64_t>(i + 1));
  EXPECT_TRUE(wait_for([&] { return link.trouble().empty() && link.stores(); })) << link.trouble();
}

TEST_F(UnreadableStore, AStoreThatStaysShutHoldsNewReportsUpOnlyForAWhile) {
  settings_.read_patience = std::chrono::seconds(1);
  disk_fails = true;
  tpr_publisher::GroundLink link(settings_);
  ASSERT_TRUE(broker_.start());
  link.send(report(kReports + 1));
  ASSERT_TRUE(wait_for([&] { return ground_->count() == 1; })) << link.trouble();
  disk_fails = false;
  ASSERT_TRUE(wait_for([&] { return ground_->count() == kReports + 1; })) << link.trouble();
  EXPECT_EQ(ground_->missing(), 0U);
}

TEST_F(UnreadableStore, AStoreThatCannotBeReadAtTheStartIsNotTakenForADamagedOne) {
  disk_fails = true;
  const auto store = tpr_publisher::ReportStore::open(settings_.store);
  disk_fails = false;
  ASSERT_FALSE(store.ok());
  EXPECT_NE(store.error().message.find(settings_.store.string()), std::string::npos) << store.error().message;
  const auto again = tpr_publisher::ReportStore::open(settings_.store);
  ASSERT_TRUE(again.ok());
  EXPECT_EQ(again.value().problem(), "");
  EXPECT_EQ(again.value().sequences().value().size(), kReports);
}

}  // namespace
}  // namespace railfix
