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
  EXPECT_THAT(text, Not(HasSubstr("railfix_position_age_seconds"))) << "no fusion was heard";
  EXPECT_THAT(text, Not(HasSubstr("railfix_recorder"))) << "no recorder has said anything";
}

std::string text_of(const TrainSeen& seen) {
  const std::vector<Problem> problems;
  return metrics_text({"t1", "0.1", "cab", &seen, {}, &problems, 0, 0, 0});
}

TEST(Metrics, SayNothingNowOfAPositionThatIsOld) {
  messaging::ServiceBoard board;
  TrainSeen seen;
  seen.services = &board;
  seen.awaited_s = 12;
  EXPECT_THAT(text_of(seen), HasSubstr("railfix_position_age_seconds 12\n"));
  seen.state.emplace();
  seen.state->speed_mps(22);
  seen.state->track_known(1);
  seen.state_age_s = 1;
  EXPECT_THAT(text_of(seen), HasSubstr("railfix_train_speed_meters_per_second 22\n"));
  EXPECT_THAT(text_of(seen), HasSubstr("railfix_position_track_known 1\n"));
  EXPECT_THAT(text_of(seen), HasSubstr("railfix_position_integrity 0\n"));
  seen.state_age_s = 14;
  seen.state_behind_s = 3;
  const auto text = text_of(seen);
  EXPECT_THAT(text, HasSubstr("railfix_position_age_seconds 14\n"));
  for (const char* name : {"train_speed_meters_per_second", "position_track_known", "position_integrity",
                           "position_over_meters", "position_behind_seconds"}) {
    EXPECT_THAT(text, HasSubstr(std::string("railfix_") + name + " Nan\n"));
  }
}

TEST(Metrics, SayNothingOfTheTrackWithoutAMap) {
  messaging::ServiceBoard board;
  TrainSeen seen;
  seen.services = &board;
  seen.no_map = true;
  seen.state.emplace();
  EXPECT_THAT(text_of(seen), HasSubstr("railfix_position_track_known Nan\n"));
}

TEST(Metrics, SayNothingNowOfAServiceThatIsSilent) {
  constexpr int64_t kSilentNs = messaging::ServiceBoard::kSilentNs;
  messaging::ServiceBoard board;
  msg::ServiceStatus status;
  status.service("fusion");
  status.host("cab");
  status.state(msg::STATE_ACTIVE);
  status.cpu_percent(50);
  status.latency_p99_ms(4);
  board.note(status, kSilentNs);
  TrainSeen seen;
  seen.services = &board;
  const std::string who = "{service=\"fusion\",host=\"cab\"";
  EXPECT_THAT(text_of(seen), HasSubstr("railfix_service_state" + who + ",state=\"active\"} 1\n"));
  EXPECT_THAT(text_of(seen), HasSubstr("railfix_service_cpu_ratio" + who + "} 0.5\n"));
  EXPECT_THAT(text_of(seen), HasSubstr("railfix_service_latency_seconds" + who + ",percentile=\"99\"} 0.004\n"));
  EXPECT_THAT(text_of(seen), HasSubstr("railfix_service_latency_seconds" + who + ",percentile=\"50\"} Nan\n"))
      << "none was measured";
  board.note_silence(2 * kSilentNs - messaging::ServiceBoard::kLookNs);
  board.note_silence(2 * kSilentNs);
  EXPECT_THAT(text_of(seen), HasSubstr("railfix_service_up" + who + "} 0\n"));
  EXPECT_THAT(text_of(seen), HasSubstr("railfix_service_state" + who + ",state=\"active\"} 0\n"));
  EXPECT_THAT(text_of(seen), HasSubstr("railfix_service_cpu_ratio" + who + "} Nan\n"));
}

TEST(Metrics, TellWhoIsExpectedAndNotOfWhomNobodyNeeds) {
  messaging::ServiceBoard board;
  msg::ServiceStatus status;
  status.service("fusion");
  status.host("cab");
  status.state(msg::STATE_STOPPED);
  board.note(status, 0);
  TrainSeen seen;
  seen.services = &board;
  EXPECT_THAT(text_of(seen), Not(HasSubstr("railfix_service_up")));
  seen.expected = {{"fusion", "cab"}, {"odometry", ""}};
  EXPECT_THAT(text_of(seen), HasSubstr("railfix_service_up{service=\"fusion\",host=\"cab\"} 0\n"));
  EXPECT_THAT(text_of(seen), HasSubstr("railfix_service_expected{service=\"fusion\",host=\"cab\"} 1\n"));
  EXPECT_THAT(text_of(seen), HasSubstr("railfix_service_expected{service=\"odometry\"} 1\n"));
  seen.played = true;
  EXPECT_THAT(text_of(seen), Not(HasSubstr("railfix_service_expected")));
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
  seen.expected = {{"fusion", ""}};
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
