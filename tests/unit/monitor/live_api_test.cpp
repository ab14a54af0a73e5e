#include "monitor/live_api.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "noted_client.hpp"

namespace railfix::monitor {
namespace {

using nlohmann::json;

class LiveApiTest : public ::testing::Test {
 protected:
  LiveApiTest() : live_(actions()), one_(std::make_shared<NotedClient>(1)), two_(std::make_shared<NotedClient>(2)) {
    live_.opened(one_);
    live_.opened(two_);
  }
  LiveApi::Actions actions() {
    return {[] {
              return json{{"kind", "hello"}};
            },
            [](const std::string& kind) {
              return std::vector<json>{{{"kind", kind}, {"first", true}}};
            },
            [this] { ++changes_; }, [this](const ClientPtr&, const ControlAsk& ask) { asks_.push_back(ask); }};
  }
  int changes_ = 0;
  std::vector<ControlAsk> asks_;
  LiveApi live_;
  std::shared_ptr<NotedClient> one_;
  std::shared_ptr<NotedClient> two_;
};

TEST_F(LiveApiTest, SendsWhatWasAskedForAndNothingElse) {
  EXPECT_EQ(one_->last()["kind"], "hello");
  EXPECT_FALSE(live_.watched("state"));
  live_.message(one_, R"({"watch": ["state", "log"]})");
  EXPECT_EQ(one_->frames.size(), 3U) << "the present values at once";
  EXPECT_TRUE(live_.watched("state"));
  live_.publish("state", {{"kind", "state"}, {"speed_mps", std::nan("")}});
  EXPECT_TRUE(one_->last()["speed_mps"].is_null());
  EXPECT_EQ(two_->frames.size(), 1U);
  EXPECT_EQ(one_->frames.back().slot, "state") << "a newer state takes its place";
  live_.publish("log", {{"kind", "log"}}, true);
  EXPECT_EQ(one_->frames.back().slot, "") << "every record is sent";
  EXPECT_EQ(one_->resumed, 1);
}

TEST_F(LiveApiTest, TellsAllWhoWatchNothing) {
  live_.tell_all("beat", {{"kind", "beat"}});
  EXPECT_EQ(one_->last()["kind"], "beat");
  EXPECT_EQ(two_->last()["kind"], "beat");
  EXPECT_EQ(two_->frames.back().slot, "beat") << "a newer one takes its place";
}

TEST_F(LiveApiTest, ForgetsWhoLeaves) {
  live_.message(one_, R"({"watch": ["state"]})");
  live_.message(two_, R"({"watch": ["state"]})");
  EXPECT_EQ(changes_, 1) << "nothing new is read for the second";
  live_.closed(one_);
  EXPECT_TRUE(live_.watched("state"));
  live_.message(two_, R"({"watch": []})");
  EXPECT_FALSE(live_.watched("state"));
  EXPECT_EQ(changes_, 2);
}

TEST_F(LiveApiTest, PutsAHeaderBeforeThePicture) {
  live_.message(one_, R"({"watch": ["view:cam0"]})");
  live_.publish_picture("view:cam0", {{"kind", "view"}}, {{"kind", "picture"}}, "JPEG");
  const auto& frame = one_->frames.back();
  EXPECT_TRUE(frame.binary);
  const std::string header = R"({"kind":"picture"})";
  const std::string length{static_cast<char>(header.size()), 0, 0, 0};
  EXPECT_EQ(*frame.bytes, length + header + "JPEG");
}

TEST_F(LiveApiTest, PassesControlOnAndAnswersToTheOneWhoAsked) {
  live_.message(one_, R"({"control": {"id": 7, "service": "recorder", "command": "start", "token": "x"}})");
  ASSERT_EQ(asks_.size(), 1U);
  EXPECT_EQ(asks_[0].service, "recorder");
  EXPECT_EQ(asks_[0].token, "x");
  live_.reply(asks_[0].client, asks_[0].id, true, "file");
  EXPECT_EQ(one_->last(), json::parse(R"({"kind": "reply", "id": 7, "done": true, "text": "file"})"));
  EXPECT_EQ(two_->frames.size(), 1U);
}

TEST_F(LiveApiTest, LetsGoOfWhoSendsNonsense) {
  for (const char* text : {"", "[]", "{", "\xff\xfe", "null"}) {
    one_->closed.clear();
    live_.message(one_, text);
    EXPECT_EQ(one_->closed, "not a JSON object") << text;
  }
  one_->closed.clear();
  const std::string deep = std::string(150'000, '[') + std::string(150'000, ']');  // would come back as a reply's id
  live_.message(one_, R"({"control": {"id": )" + deep + "}}");
  EXPECT_EQ(one_->closed, "not a JSON object");
  EXPECT_TRUE(asks_.empty());
  for (const char* text : {"{}", R"({"watch": 1})", R"({"watch": [1, null]})", R"({"control": []})"}) {
    one_->closed.clear();
    live_.message(one_, text);
    EXPECT_EQ(one_->closed, "") << text;
  }
}

}  // namespace
}  // namespace railfix::monitor
