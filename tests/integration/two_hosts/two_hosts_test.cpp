// A train on two computers: the sensors' side in the cab, reports and monitor in the coach. Real services, real DDS,
// two network namespaces with a cable.
#include <gmock/gmock.h>

#include "integration/two_hosts/two_hosts_train.hpp"
#include "service/health_file.hpp"

namespace railfix {
namespace {

constexpr uint64_t kPictures = 60;

TEST_F(TwoHostsTest, StatesAndReportsCrossTheCableAndPicturesDoNot) {
  auto fusion = start(TwoHosts::cab, "railfix-fusion");
  auto reports = start(TwoHosts::coach, "railfix-tpr-publisher");
  auto monitor = start(TwoHosts::coach, "railfix-monitor", {"monitor.port=0", "monitor.foxglove_port=-1"});
  const auto pictures_file = folder_ / "pictures";
  const auto states_file = folder_ / "states";
  auto pictures_in_coach = count_in_coach("camera_frame/cam0", pictures_file);
  auto states_in_coach = count_in_coach("train_state", states_file);
  Camera camera(*cab_);
  uint64_t pictures_in_cab = 0;
  uint64_t reports_in_cab = 0;
  std::set<std::string> services;
  messaging::Reader<msg::CameraFrame> near(*cab_, topics::camera_frame, "cam0", queue_,
                                           [&](const msg::CameraFrame&) { ++pictures_in_cab; });
  messaging::Reader<msg::TrainPositionReport> report(*cab_, topics::train_position_report, "", queue_,
                                                     [&](const msg::TrainPositionReport&) { ++reports_in_cab; });
  messaging::Reader<msg::ServiceStatus> status(
      *cab_, topics::service_status, "", queue_, [&](const msg::ServiceStatus& one) {
        services.insert(one.service().c_str() + std::string("@") + one.host().c_str());
      });
  ASSERT_TRUE(run_until([&] { return camera.heard() && services.size() == 3; }))
      << "heard of " << ::testing::PrintToString(services);
  EXPECT_THAT(services, ::testing::ElementsAre("fusion@cab", "monitor@coach", "tpr_publisher@coach"));
  const auto said = [](const fs::path& file, const char* what) {
    return test::slurp(file).find(what) != std::string::npos;
  };
  ASSERT_TRUE(run_until([&] { return said(pictures_file, "has no writer"); })) << test::slurp(pictures_file);

  const uint64_t bytes_before = hosts_.bytes_on_cable();
  for (uint64_t i = 1; i <= kPictures; ++i) {
    camera.shoot();
    ASSERT_TRUE(run_until([&] { return pictures_in_cab >= i; })) << "picture " << i << " did not reach its own host";
  }
  ASSERT_TRUE(run_until([&] {
    camera.step();
    return reports_in_cab > 0 && said(states_file, "train_state: ");
  })) << "no report has come back over the cable";
  const uint64_t bytes = hosts_.bytes_on_cable() - bytes_before;
  std::cout << "cable: " << bytes << " bytes, pictures in the cab: " << kPictures * kWidthPx * kHeightPx << " bytes\n";
  EXPECT_EQ(pictures_in_coach->end(SIGTERM), 1) << "pictures in the coach:\n" << test::slurp(pictures_file);
  EXPECT_GT(bytes, 1000U);
  EXPECT_LT(bytes, kPictures * kWidthPx * kHeightPx / 20);
}

TEST_F(TwoHostsTest, AServiceStartedWithoutTheCableEndsToBeStartedAgainWhenThereIsOne) {
  hosts_.plug(false);
  auto fusion = start(TwoHosts::cab, "railfix-fusion");
  service::CommonConfig common;
  common.train_id = train_;
  common.host = "cab";
  const auto health = service::health_path(common, "fusion");
  ASSERT_TRUE(run_until([&] { return service::ask_health(health).healthy; }));
  EXPECT_FALSE(fusion->exit_code());
  hosts_.plug(true);
  ASSERT_TRUE(run_until([&] { return fusion->exit_code().has_value(); })) << "does not mind the cable";
  EXPECT_EQ(fusion->exit_code(), 0);
}

}  // namespace
}  // namespace railfix
