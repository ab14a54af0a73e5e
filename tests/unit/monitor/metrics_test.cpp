#include "monitor/metrics.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <regex>
#include <set>

namespace railfix::monitor {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

TEST(Metrics, SayWhatIsKnownAndLeaveOutWhatIsNot) {
  messaging::ServiceBoard board;
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

std::string read(const std::string& name) {
  std::ifstream file(std::filesystem::path(RAILFIX_SOURCE_DIR) / "deploy" / "monitoring" / name);
  return {std::istreambuf_iterator<char>(file), {}};
}

TEST(Metrics, HaveEverySeriesThatAlertsAndDashboardName) {
  messaging::ServiceBoard board;
  msg::ServiceStatus status;
  status.service("fusion");
  board.note(status, 0);
  TrainSeen seen;
  seen.services = &board;
  seen.state.emplace();
  seen.recorder.emplace();
  seen.shared_memory_free_mb = 1;
  seen.certificates = {{"fusion", "cab", 300}};
  const std::vector<Problem> problems;
  MetricTopic topic;
  topic.name = "train_state";
  const auto text = metrics_text({"t1", "0.1", "cab", &seen, {topic}, &problems, 0, 0, 0});

  const auto dashboard = nlohmann::json::parse(read("grafana-dashboard.json"));
  std::string named = read("alerts.yml");
  for (const auto& panel : dashboard["panels"]) {
    for (const auto& target : panel["targets"]) named += target["expr"].get<std::string>() + "\n";
  }
  static const std::regex kName("railfix_[a-z_]+");
  std::set<std::string> names;
  for (std::sregex_iterator name(named.begin(), named.end(), kName), end; name != end; ++name)
    names.insert(name->str());
  EXPECT_GT(names.size(), 20U);
  for (const auto& name : names) EXPECT_THAT(text, ::testing::ContainsRegex("\n" + name + "[{ ]")) << name;
}

}  // namespace
}  // namespace railfix::monitor
