// Stores that cannot be opened when the service starts, and those that have lost their newest reports.
#include "integration/tpr/ground_link_fixture.hpp"

namespace railfix {
namespace {

using ::testing::HasSubstr;
namespace fs = std::filesystem;

class StoreAtTheStart : public GroundLinkTest {
 protected:
  void SetUp() override {
    GroundLinkTest::SetUp();
    if (IsSkipped()) return;
    ASSERT_TRUE(broker_.start());
    ASSERT_TRUE(ground_.emplace(broker_.address(), train_).subscribed());
  }
  test::Broker broker_{file("broker")};
  std::optional<Ground> ground_;
};

TEST_F(StoreAtTheStart, ReportsGoFromMemoryUntilItCanBeOpened) {
  auto settings = link_settings(broker_.address());
  settings.store = file("disk") / "link.db";
  settings.read_patience = std::chrono::seconds(1);
  tpr_publisher::GroundLink link(settings);
  EXPECT_FALSE(link.stores());
  EXPECT_THAT(link.trouble(), HasSubstr(settings.store.string() + ": unable to open database file. "));
  link.send(report(1));
  link.send(report(2));
  ASSERT_TRUE(wait_for([&] { return ground_->count() == 2; })) << link.trouble();
  ASSERT_TRUE(wait_for([&] { return says(link, "Reports go from memory: "); })) << link.trouble();
  fs::create_directories(file("disk"));
  ASSERT_TRUE(wait_for([&] { return link.stores() && link.trouble().empty(); })) << link.trouble();
  EXPECT_TRUE(fs::exists(settings.store));
  link.send(report(3));
  ASSERT_TRUE(wait_for([&] { return ground_->count() == 3; })) << link.trouble();
  const auto arrived = ground_->reports();
  for (size_t i = 0; i < 3; ++i) {
    EXPECT_EQ(arrived[i].stamp_ns, static_cast<int64_t>(i + 1));
    EXPECT_EQ(arrived[i].sequence, i + 1);
    EXPECT_EQ(arrived[i].stream, arrived[0].stream);
  }
}

TEST_F(StoreAtTheStart, WhatLiesOnADiskThatIsMountedLateGoesBeforeWhatIsNew) {
  auto settings = link_settings(broker_.address());
  settings.store = file("disk") / "link.db";
  fs::create_directories(file("disk"));
  broker_.stop();
  {
    tpr_publisher::GroundLink before(settings);
    for (uint64_t i = 1; i <= 3; ++i) before.send(report(i));
  }
  fs::rename(file("disk"), file("away"));
  ASSERT_TRUE(broker_.start());
  tpr_publisher::GroundLink link(settings);
  link.send(report(4));
  ASSERT_TRUE(wait_for([&] { return link.connected() && says(link, "it: 1 wait in memory"); })) << link.trouble();
  fs::rename(file("away"), file("disk"));
  link.send(report(5));
  ASSERT_TRUE(wait_for([&] { return ground_->count() == 5; })) << link.trouble();
  const auto arrived = ground_->reports();
  for (size_t i = 0; i < 5; ++i) EXPECT_EQ(arrived[i].stamp_ns, static_cast<int64_t>(i + 1));
}

TEST_F(StoreAtTheStart, WhatWaitsForOneThatStaysShutGoesAtTheEnd) {
  auto settings = link_settings(broker_.address());
  settings.warn = [](const std::string& sentence) { ADD_FAILURE() << sentence; };
  auto other = settings;
  other.mqtt.client_id += "-other";
  const tpr_publisher::GroundLink has_the_store(other);
  ASSERT_TRUE(wait_for([&] { return has_the_store.connected(); }));
  {
    tpr_publisher::GroundLink link(settings);
    for (uint64_t i = 1; i <= 3; ++i) link.send(report(i));
    ASSERT_TRUE(wait_for([&] { return link.connected() && says(link, "it: 3 wait in memory"); })) << link.trouble();
    EXPECT_EQ(ground_->count(), 0U);
  }
  ASSERT_TRUE(wait_for([&] { return ground_->count() == 3; }));
}

TEST_F(StoreAtTheStart, WhatIsLostAtTheEndIsTold) {
  auto settings = link_settings(broker_.address());
  settings.store = file("disk") / "link.db";
  std::vector<std::string> told;
  settings.warn = [&](const std::string& sentence) { told.push_back(sentence); };
  broker_.stop();
  {
    tpr_publisher::GroundLink link(settings);
    link.send(report(1));
    link.send(report(2));
  }
  const std::string text = "2 reports for the ground are lost: at the end they could not be stored (";
  EXPECT_THAT(told, testing::ElementsAre(HasSubstr(text + settings.store.string() + ": unable to open")));
}

TEST_F(StoreAtTheStart, TheTrainGetsItsReportsWithoutOne) {
  const auto disk = file("disk");
  const std::string link = "tpr_publisher.ground_link.";
  test::Program program(service({"tpr_publisher.d_cycloc_m=1", link + "broker=" + broker_.address(),
                                 link + "longest_retry_s=0.2", link + "store=" + (disk / "reports.db").string()}));
  ASSERT_TRUE(run_until([&] { return connected(); }, [] {}));
  ASSERT_TRUE(run_for(3));
  ASSERT_TRUE(status_says("unable to open database file. Reports wait up to 60 s for those that may lie in it: "));
  EXPECT_EQ(status_->state(), msg::STATE_DEGRADED);
  fs::create_directories(disk);
  ASSERT_TRUE(run_until([&] { return status_->state() == msg::STATE_ACTIVE && ground_->count() >= 3; },
                        [&] { write_state(last_.offset_m); }))
      << reason();
}

// As from a disk that lies, or a copy that was put back: the log beside the file is gone.
TEST_F(StoreAtTheStart, NoNumberComesTwiceWhenItHasLostItsNewestReports) {
  auto settings = link_settings(broker_.address());
  const auto send_two = [&](uint64_t first) {
    tpr_publisher::GroundLink link(settings);
    const auto before = ground_->count() + ground_->twice();
    for (uint64_t i = first; i < first + 2; ++i) link.send(report(i));
    EXPECT_TRUE(wait_for([&] { return ground_->count() + ground_->twice() == before + 2; })) << link.trouble();
    EXPECT_TRUE(wait_for([&] { return link.trouble().empty(); }));
    if (first == 3) fs::copy_file(settings.store, file("copy.db"));
  };
  send_two(1);
  send_two(3);
  settings.store = file("copy.db");
  send_two(5);
  EXPECT_EQ(ground_->twice(), 0U) << "new reports under the numbers of others";
  EXPECT_EQ(ground_->count(), 6U);
}

}  // namespace
}  // namespace railfix
