#include "monitor/foxglove_api.hpp"

#include <gtest/gtest.h>

#include "noted_client.hpp"

namespace railfix::monitor {
namespace {

using nlohmann::json;

class FoxgloveApiTest : public ::testing::Test {
 protected:
  FoxgloveApiTest()
      : api_({"test",
              {{"session", "1"}},
              [this] { ++changes_; },
              [](const std::string& topic) {
                return topic == "standing" ? std::vector<FoxgloveMessage>{{5, "old"}} : std::vector<FoxgloveMessage>{};
              }}),
        client_(std::make_shared<NotedClient>(1)) {
    api_.set_channels(channels());
    api_.opened(client_);
  }
  static std::vector<FoxgloveChannel> channels() {
    return {{"state", "cdr", "railfix::msg::TrainState", "module railfix {};", "omgidl", false},
            {"picture", "protobuf", "foxglove.CompressedImage", "\x01\x02\xff", "protobuf", true},
            {"standing", "cdr", "railfix::msg::Any", "", "omgidl", false}};
  }
  [[nodiscard]] uint32_t id_of(const std::string& topic) const {
    const auto advertised = client_->message(1);
    for (const auto& channel : advertised["channels"]) {
      if (channel["topic"] == topic) return channel["id"];
    }
    return 0;
  }
  void subscribe(uint32_t id, const std::string& topic) {
    const json message{{"op", "subscribe"}, {"subscriptions", {{{"id", id}, {"channelId", id_of(topic)}}}}};
    api_.message(client_, message.dump(), false);
  }
  int changes_ = 0;
  FoxgloveApi api_;
  std::shared_ptr<NotedClient> client_;
};

TEST(Foxglove, ChoosesTheSubprotocol) {
  EXPECT_EQ(foxglove_subprotocol({"foxglove.websocket.v1", "foxglove.sdk.v1"}), "foxglove.websocket.v1");
  EXPECT_EQ(foxglove_subprotocol({"foxglove.sdk.v1", "foxglove.websocket.v1"}), "foxglove.sdk.v1");
  EXPECT_EQ(foxglove_subprotocol({"other", "foxglove.websocket.v1"}), "foxglove.websocket.v1");
  EXPECT_EQ(foxglove_subprotocol({"foxglove.sdk.v2"}), "");
  EXPECT_EQ(foxglove_subprotocol({}), "");
}

TEST(Foxglove, WritesBase64AsRfc4648Does) {
  const std::vector<std::pair<std::string, std::string>> vectors{{"", ""},
                                                                 {"f", "Zg=="},
                                                                 {"fo", "Zm8="},
                                                                 {"foo", "Zm9v"},
                                                                 {"foob", "Zm9vYg=="},
                                                                 {"fooba", "Zm9vYmE="},
                                                                 {"foobar", "Zm9vYmFy"}};
  for (const auto& [bytes, text] : vectors) EXPECT_EQ(base64(bytes), text);
}

TEST_F(FoxgloveApiTest, SaysWhoItIsAndWhatThereIs) {
  EXPECT_EQ(client_->message(0)["op"], "serverInfo");
  EXPECT_EQ(client_->message(0)["capabilities"], json::array());
  const auto advertised = client_->message(1);
  EXPECT_EQ(advertised["op"], "advertise");
  ASSERT_EQ(advertised["channels"].size(), 3U);
  for (const auto& channel : advertised["channels"]) {
    if (channel["topic"] == "picture") {
      EXPECT_EQ(channel["schema"], "AQL/");
    }
    if (channel["topic"] == "state") {
      EXPECT_EQ(channel["schema"], "module railfix {};");
    }
  }
}

TEST_F(FoxgloveApiTest, SendsMessagesByTheSubscriptionsId) {
  api_.publish("state", {1, "nobody"});
  EXPECT_EQ(client_->frames.size(), 2U);
  subscribe(77, "state");
  EXPECT_TRUE(api_.watched("state"));
  EXPECT_EQ(changes_, 1);
  api_.publish("state", {0x0102030405060708, "CDR"});
  const auto& frame = client_->frames.back();
  EXPECT_TRUE(frame.binary);
  EXPECT_TRUE(frame.droppable);
  EXPECT_EQ(*frame.bytes, (std::string{1, 77, 0, 0, 0, 8, 7, 6, 5, 4, 3, 2, 1} + "CDR"));
  EXPECT_EQ(frame.slot, "");
  subscribe(78, "picture");
  api_.publish("picture", {1, "P"});
  EXPECT_NE(client_->frames.back().slot, "") << "only the newest picture waits";
  api_.message(client_, R"({"op": "unsubscribe", "subscriptionIds": [77]})", false);
  EXPECT_FALSE(api_.watched("state"));
}

TEST_F(FoxgloveApiTest, GivesAStandingValueAtOnce) {
  subscribe(5, "standing");
  EXPECT_EQ(client_->frames.back().bytes->substr(13), "old");
}

TEST_F(FoxgloveApiTest, AnswersMistakesWithAStatus) {
  subscribe(1, "state");
  const std::vector<std::string> mistakes{R"({"op": "subscribe", "subscriptions": [{"id": 1, "channelId": 1}]})",
                                          R"({"op": "subscribe", "subscriptions": [{"id": 9, "channelId": 4711}]})",
                                          R"({"op": "subscribe", "subscriptions": [{"id": -1, "channelId": 1}, 3]})",
                                          R"({"op": "getParameters", "parameterNames": []})",
                                          "no JSON",
                                          R"({"op": )" + std::string(150'000, '[') + std::string(150'000, ']') + "}",
                                          R"({"noop": 1})"};
  for (const auto& mistake : mistakes) {
    api_.message(client_, mistake, false);
    EXPECT_EQ(client_->last()["op"], "status") << mistake;
    EXPECT_GE(client_->last()["level"], 1) << mistake;
  }
  api_.message(client_, std::string("\x01\0\0\0\0", 5), true);
  EXPECT_EQ(client_->last()["op"], "status");
  EXPECT_EQ(client_->resumed, static_cast<int>(mistakes.size()) + 2);
}

TEST_F(FoxgloveApiTest, TellsOfChannelsThatComeAndGo) {
  subscribe(1, "picture");
  auto fewer = channels();
  fewer.erase(fewer.begin() + 1);
  api_.set_channels(fewer);
  EXPECT_EQ(client_->last(), json({{"op", "unadvertise"}, {"channelIds", {id_of("picture")}}}));
  EXPECT_FALSE(api_.watched("picture"));
  api_.set_channels(channels());
  EXPECT_EQ(client_->last()["op"], "advertise");
  EXPECT_EQ(client_->last()["channels"][0]["id"], id_of("picture")) << "the same channel has the same id";
}

}  // namespace
}  // namespace railfix::monitor
