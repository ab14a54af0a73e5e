#include "recorder/event_rule.hpp"

#include <gmock/gmock.h>

#include <limits>

#include "messaging/topics.hpp"
#include "recorder/standing.hpp"

namespace railfix::recorder {

namespace {

using ::testing::HasSubstr;

std::string type_of(const std::string& topic) {
  const auto* info = messaging::find_topic(topic);
  return info == nullptr ? "" : info->type->name();
}

EventRule rule(const std::string& text) {
  auto parsed = EventRule::parse(text, type_of);
  EXPECT_TRUE(parsed.ok()) << (parsed.ok() ? "" : parsed.error().message);
  return parsed.value();
}

std::string error_of(const std::string& text) {
  const auto parsed = EventRule::parse(text, type_of);
  return parsed.ok() ? "" : parsed.error().message;
}

template <class T>
StoredSample sample(const messaging::Topic<T>& topic, const T& value) {
  const auto yes_no = [](bool yes) { return yes ? "true" : "false"; };
  const messaging::TopicInfo info = messaging::info_of(topic);
  return {std::make_shared<const ChannelOf>(ChannelOf{
              info.name,
              info.type->name(),
              "",
              {{"transient_local", yes_no(info.qos.transient_local)}, {"keyed", yes_no(info.type->keyed())}}}),
          1,
          0,
          0,
          messaging::serialize(value),
          ""};
}

StoredSample state(uint8_t integrity, double speed_mps = 0) {
  msg::TrainState state;
  state.integrity(integrity);
  state.speed_mps(speed_mps);
  return sample(messaging::topics::train_state, state);
}

StoredSample status(const std::string& service, uint8_t of) {
  msg::ServiceStatus status;
  status.service(service);
  status.state(of);
  return sample(messaging::topics::service_status, status);
}

TEST(EventRule, HappensWhenItBeginsToHold) {
  EventRule integrity = rule("train_state.integrity != ok");
  EXPECT_TRUE(integrity.concerns("train_state"));
  EXPECT_FALSE(integrity.concerns("train_pose"));
  EXPECT_FALSE(integrity.begins(state(msg::INTEGRITY_OK)));
  EXPECT_TRUE(integrity.begins(state(msg::INTEGRITY_DEGRADED)));
  EXPECT_FALSE(integrity.begins(state(msg::INTEGRITY_UNUSABLE))) << "it holds already";
  EXPECT_FALSE(integrity.begins(state(msg::INTEGRITY_OK)));
  EXPECT_TRUE(integrity.begins(state(msg::INTEGRITY_UNUSABLE)));
}

TEST(EventRule, TellsWritersApartByTheirKey) {
  EventRule failed = rule("service_status.state == FAILED");
  EXPECT_TRUE(failed.begins(status("odometry", msg::STATE_FAILED)));
  EXPECT_TRUE(failed.begins(status("fusion", msg::STATE_FAILED)));
  EXPECT_FALSE(failed.begins(status("odometry", msg::STATE_FAILED)));
  EXPECT_FALSE(failed.begins(status("odometry", msg::STATE_ACTIVE)));
  EXPECT_TRUE(failed.begins(status("odometry", msg::STATE_FAILED)));
}

TEST(EventRule, ComparesNumbersTextsAndBits) {
  EventRule fast = rule("train_state.speed_mps>30.5");
  EXPECT_FALSE(fast.begins(state(0, 30.5)));
  EXPECT_FALSE(fast.begins(state(0, std::numeric_limits<double>::quiet_NaN()))) << "not known";
  EXPECT_TRUE(fast.begins(state(0, 30.6)));
  EventRule not_equal = rule("train_state.speed_mps != 3");
  EXPECT_FALSE(not_equal.begins(state(0, std::numeric_limits<double>::quiet_NaN())));

  msg::LogRecord record;
  record.level(3);
  record.text("the disk is slow");
  EventRule error = rule("log_record.level >= error");  // from "4 error" in the IDL
  EventRule disk = rule("log_record.text has disk is");
  EXPECT_FALSE(error.begins(sample(messaging::topics::log_record, record)));
  EXPECT_TRUE(disk.begins(sample(messaging::topics::log_record, record)));
  record.level(5);
  EXPECT_TRUE(error.begins(sample(messaging::topics::log_record, record)));

  msg::CameraPreview picture;
  picture.health(msg::PICTURE_DARK | msg::PICTURE_COVERED);
  auto seen = sample(messaging::topics::camera_preview, picture);
  // As the recorder stores pictures of camera_frame.
  EXPECT_TRUE(rule("camera_frame.health has covered").begins(seen));
  EXPECT_FALSE(rule("camera_frame.health has blurred").begins(seen));
  EXPECT_TRUE(rule("camera_preview/cam0.health != 0").concerns("camera_preview/cam0"));
  EXPECT_FALSE(rule("camera_preview/cam0.health != 0").concerns("camera_preview/rear"));
  EXPECT_TRUE(rule("camera_preview.health != 0").concerns("camera_preview/rear"));
}

// Of one service there may be no milder line between two errors, and they are not the same.
TEST(EventRule, EachLineOfALogIsAnEventOfItsOwn) {
  EventRule error = rule("log_record.level >= error");
  msg::LogRecord record;
  record.level(4);
  for (int i = 0; i < 2; ++i) EXPECT_TRUE(error.begins(sample(messaging::topics::log_record, record)));
  record.level(2);
  EXPECT_FALSE(error.begins(sample(messaging::topics::log_record, record)));
}

TEST(EventRule, LooksIntoArrays) {
  msg::PositionFix fix;
  fix.alternative_probability()[2] = 0.4;
  EXPECT_TRUE(
      rule("position_fix.alternative_probability.2 > 0.3").begins(sample(messaging::topics::position_fix, fix)));
  EXPECT_FALSE(
      rule("position_fix.alternative_probability.1 > 0.3").begins(sample(messaging::topics::position_fix, fix)));
}

TEST(EventRule, ATopicAloneMeansEverySample) {
  EventRule any = rule(" train_state ");
  EXPECT_TRUE(any.begins(state(0)));
  EXPECT_TRUE(any.begins(state(0)));
}

TEST(EventRule, SaysWhatIsWrong) {
  EXPECT_THAT(error_of("train_sate.integrity != ok"), HasSubstr("names the topic 'train_sate', which there is not"));
  EXPECT_THAT(error_of("train_state.integrety != ok"), HasSubstr("railfix::msg::TrainState has stamp_ns, "));
  EXPECT_THAT(error_of("train_state.integrity != fine"), HasSubstr("none of DEGRADED, OK, UNUSABLE"));
  EXPECT_THAT(error_of("train_state.speed_mps > fast"), HasSubstr("'fast', which is no number"));
  EXPECT_THAT(error_of("train_state.integrity is ok"), HasSubstr("neither 'TOPIC.FIELD OP VALUE' nor 'TOPIC'"));
  EXPECT_THAT(error_of("position_fix.alternative_probability > 0"), HasSubstr("more than one value"));
  EXPECT_THAT(error_of("train_state.integrity.x > 0"), HasSubstr("which has no parts"));
  EXPECT_THAT(error_of(""), HasSubstr("neither"));
}

TEST(Standing, IsToldByTopicAndKey) {
  const auto odometry = status("odometry", 1);
  EXPECT_EQ(standing_of(*odometry.channel, odometry.cdr), "service_status\n\"odometry\"\n\"\"");
  EXPECT_EQ(standing_of(*state(0).channel, state(0).cdr), "");
}

}  // namespace

}  // namespace railfix::recorder
