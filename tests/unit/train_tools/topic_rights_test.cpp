// The rights that certificates give against the topics there are.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>

#include "messaging/charge_topic.hpp"
#include "messaging/onboard_topic.hpp"
#include "messaging/topics.hpp"
#include "service/service.hpp"
#include "train/topic_rights.hpp"

namespace railfix::tool {
namespace {

std::vector<std::string> rights() {
  std::vector<std::string> all = topics_written_by_all();
  auto names = service::service_names();
  names.insert(names.end(), {"onboard", kOperator});
  for (const auto& name : names) {
    const auto& own = topics_written_by(name);
    all.insert(all.end(), own.begin(), own.end());
  }
  for (auto& topic : all) topic = topic.substr(0, topic.find('/'));
  return all;
}

// in_charge is between those that share a charge: no tool knows it.
bool is_there(const std::string& topic) {
  return topic == messaging::topics::in_charge.name || messaging::find_topic(topic) != nullptr;
}

TEST(TopicRights, EveryTopicHasOneThatMayWriteIt) {
  for (const auto& topic : messaging::all_topics()) EXPECT_THAT(rights(), ::testing::Contains(topic.name));
}

TEST(TopicRights, NoRightIsForATopicThatIsNotThere) {
  for (const auto& right : rights()) EXPECT_TRUE(is_there(right)) << right;
}

TEST(TopicRights, EveryRightToReadIsForATopicThatIsThere) {
  for (const auto& name : service::service_names()) {
    for (const auto& topic : topics_read_by(name)) {
      const std::string base = topic.substr(0, topic.find('/'));
      EXPECT_TRUE(topic == "*" || is_there(base)) << name << ": " << topic;
    }
  }
}

TEST(TopicRights, PositionsAndReportsHaveOneServiceEach) {
  const auto writers = [](const std::string& topic) {
    std::vector<std::string> names;
    for (const auto& name : service::service_names()) {
      const auto& own = topics_written_by(name);
      if (std::find(own.begin(), own.end(), topic) != own.end()) names.push_back(name);
    }
    return names;
  };
  EXPECT_THAT(writers("train_state"), ::testing::ElementsAre("fusion"));
  EXPECT_THAT(writers("train_position_report"), ::testing::ElementsAre("tpr_publisher"));
  EXPECT_THAT(writers("position_fix"), ::testing::ElementsAre("map_matcher"));
}

}  // namespace
}  // namespace railfix::tool
