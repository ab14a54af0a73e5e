#include "monitor/metrics.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace railfix::monitor {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

TEST(Metrics, SayWhatIsKnownAndLeaveOutWhatIsNot) {
  ServiceBoard board;
  msg::ServiceStatus status;
  status.service("fusion");
  status.host("cab \"A\"");
  status.state(msg::STATE_ACTIVE);
  board.note(status, 1'000'000'000);
  TrainSeen seen;
  seen.now_ns = 3'000'000'000;
  seen.services = &board;
  MetricTopic topic;
  topic.name = "train_state";
  topic.numbers.samples = 6;
  topic.latency_counts[0] = 2;
  topic.latency_counts[3] = 3;
  topic.latency_counts.back() = 1;
  const std::vector<Problem> problems{{"x", Level::error, "", "", 0}};
  const auto text = metrics_text({"t1", "0.1", "cab", &seen, {topic}, &problems, 4, 2, 1});
  EXPECT_THAT(text, HasSubstr("railfix_service_up{service=\"fusion\",host=\"cab \\\"A\\\"\"} 1\n"));
  EXPECT_THAT(text, HasSubstr("railfix_service_heartbeat_age_seconds{service=\"fusion\",host=\"cab \\\"A\\\"\"} 2\n"));
  EXPECT_THAT(text, HasSubstr("railfix_topic_latency_seconds_bucket{topic=\"train_state\",le=\"0.005\"} 5\n"));
  EXPECT_THAT(text, HasSubstr("railfix_topic_latency_seconds_bucket{topic=\"train_state\",le=\"+Inf\"} 6\n"));
  EXPECT_THAT(text, HasSubstr("railfix_topic_latency_seconds_count{topic=\"train_state\"} 6\n"));
  EXPECT_THAT(text, HasSubstr("railfix_topic_age_seconds{topic=\"train_state\"} Nan"));
  EXPECT_THAT(text, HasSubstr("railfix_problems{level=\"error\"} 1\n"));
  EXPECT_THAT(text, HasSubstr("railfix_position_reports_total 4\n"));
  EXPECT_THAT(text, Not(HasSubstr("railfix_position_age_seconds"))) << "there was no position yet";
  EXPECT_THAT(text, Not(HasSubstr("railfix_recorder"))) << "no recorder has said anything";
}

}  // namespace
}  // namespace railfix::monitor
