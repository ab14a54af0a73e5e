// Message types as Fast DDS uses them.
#include <gtest/gtest.h>

#include <thread>

#include "messaging/fastdds_types.hpp"
#include "messaging/topics.hpp"

namespace railfix::messaging {
namespace {

using Key = eprosima::fastrtps::rtps::InstanceHandle_t;

msg::ServiceStatus status_of(const std::string& service) {
  msg::ServiceStatus status;
  status.service(service);
  status.host("a host with a name that is long enough");
  return status;
}

// As a service that writes its own status while it reads those of others: with both in one buffer a status got a key of
// nobody, and the recorder's first one was handed to every newcomer for hours.
TEST(Types, AKeyIsRightWhicheverThreadsAskForOthersMeanwhile) {
  const auto& type = dynamic_cast<const FastDdsType&>(type_of<msg::ServiceStatus>());
  auto support = type.support();
  const auto count_wrong = [&support](const std::string& service) {
    constexpr int kTimes = 100'000;
    auto status = status_of(service);
    Key right;
    auto alone = dynamic_cast<const FastDdsType&>(type_of<msg::ServiceStatus>()).support();
    alone->getKey(&status, &right, false);
    int wrong = 0;
    for (int i = 0; i < kTimes; ++i) {
      Key key;
      support->getKey(&status, &key, false);
      wrong += key == right ? 0 : 1;
    }
    return wrong;
  };
  int others_wrong = -1;
  std::thread reader([&] { others_wrong = count_wrong("odometry"); });
  const int own_wrong = count_wrong("recorder");
  reader.join();
  EXPECT_EQ(own_wrong, 0);
  EXPECT_EQ(others_wrong, 0);
}

}  // namespace
}  // namespace railfix::messaging
