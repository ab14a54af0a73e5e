// A writer that offers less than a service asks for is told, as long as it is there.
#include <gmock/gmock.h>

#include "messaging/topics.hpp"
#include "support/network.hpp"
#include "support/program.hpp"
#include "support/run_until.hpp"

namespace railfix {
namespace {

namespace fs = std::filesystem;
namespace topics = messaging::topics;

constexpr int kDomain = 85;

TEST(Qos, AWriterThatDoesNotFitIsTold) {
  const std::string train = "qos-" + std::to_string(getpid());
  const fs::path profiles = fs::temp_directory_path() / (train + ".xml");
  std::string xml = messaging::qos_xml();
  const std::string reliable = "<kind>RELIABLE</kind>";
  const size_t at = xml.find(reliable, xml.find("<data_writer profile_name=\"odometry_step\">"));
  ASSERT_NE(at, std::string::npos);
  std::ofstream(profiles) << xml.replace(at, reliable.size(), "<kind>BEST_EFFORT</kind>");

  auto options = test::network(train, kDomain);
  messaging::Participant participant(options);
  messaging::Queue queue;
  std::optional<msg::ServiceStatus> status;
  const messaging::Reader<msg::ServiceStatus> reader(participant, topics::service_status, "", queue,
                                                     [&](const msg::ServiceStatus& one) { status = one; });
  test::Program fusion(test::with_settings(
      "railfix-fusion",
      {"common.train_id=" + train, "common.domain=" + std::to_string(kDomain), "common.log_level=error"}));
  ASSERT_TRUE(test::run_until(queue, [&] { return status && status->state() == msg::STATE_READY; }));

  options.service = "odometry";
  options.host = "cab";
  options.qos_profiles = profiles;
  auto other = std::make_unique<messaging::Participant>(options);
  auto steps = std::make_unique<messaging::Writer<msg::OdometryStep>>(*other, topics::odometry_step);
  EXPECT_TRUE(test::run_until(queue, [&] { return status->state() == msg::STATE_DEGRADED; }));
  EXPECT_STREQ(status->reason().c_str(),
               "odometry_step of odometry@cab is not heard, its quality of service does not fit: the reader wants "
               "RELIABLE, the writer offers BEST_EFFORT");
  steps.reset();
  other.reset();
  EXPECT_TRUE(test::run_until(queue, [&] { return status->state() == msg::STATE_READY; }));
  EXPECT_STREQ(status->reason().c_str(), "");
  fs::remove(profiles);
}

}  // namespace
}  // namespace railfix
