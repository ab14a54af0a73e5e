// `railfix top`, `topics bw|delay` and `log` as real processes, beside a real recorder and this test as a train.
#include <gmock/gmock.h>

#include <atomic>
#include <nlohmann/json.hpp>
#include <regex>
#include <thread>

#include "core/time.hpp"
#include "messaging/topics.hpp"
#include "support/network.hpp"
#include "support/program.hpp"
#include "support/run_until.hpp"

namespace railfix {
namespace {

namespace fs = std::filesystem;
namespace topics = messaging::topics;
using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;

const std::string kDomain = "89";

/// Says something twenty times a second while it lives.
class Talker {
 public:
  explicit Talker(const std::string& train, bool with_standby = false)
      : participant_(test::network(train, std::stoi(kDomain))),
        with_standby_(with_standby),
        states_(participant_, topics::train_state),
        logs_(participant_, topics::log_record),
        statuses_(participant_, topics::service_status),
        thread_([this] { talk(); }) {}
  ~Talker() {
    ended_ = true;
    thread_.join();
  }

 private:
  void talk() {
    while (!ended_) {
      msg::TrainState state;
      state.stamp_ns(core::wall_ns());
      state.grabbed_ns(core::wall_ns() - 30'000'000);
      states_.write(state);
      log("fusion", 2, "goes on");
      log("fusion", 3, "wheel slides");
      log("odometry", 4, "camera is blind");
      log("recorder", 2, "cut off \xC3");
      say("cab", msg::STATE_DEGRADED, "no wheel");
      if (with_standby_) say("coach", msg::STATE_READY, "stands by, cab is in charge");
      std::this_thread::sleep_for(std::chrono::milliseconds(50));
    }
  }
  void say(const char* host, uint8_t state, const char* reason) {
    msg::ServiceStatus status;
    status.service("fusion");
    status.host(host);
    status.state(state);
    status.reason(reason);
    statuses_.write(status);
  }
  void log(const char* service, uint8_t level, const char* text) {
    msg::LogRecord record;
    record.stamp_ns(core::wall_ns());
    record.service(service);
    record.level(level);
    record.text(text);
    logs_.write(record);
  }
  messaging::Participant participant_;
  bool with_standby_;
  messaging::Writer<msg::TrainState> states_;
  messaging::Writer<msg::LogRecord> logs_;
  messaging::Writer<msg::ServiceStatus> statuses_;
  std::atomic<bool> ended_ = false;
  std::thread thread_;
};

class Terminal : public ::testing::Test {
 protected:
  void SetUp() override { fs::create_directories(folder_); }
  void TearDown() override { fs::remove_all(folder_); }
  [[nodiscard]] test::Outcome railfix(std::vector<std::string> arguments) const {
    arguments.insert(arguments.begin(), "railfix");
    arguments.insert(arguments.end(), {"--train", train_, "--domain", kDomain});
    return test::run_program(arguments, 60);
  }
  [[nodiscard]] nlohmann::json top() const {
    const auto top = railfix({"top", "--json", "--for", "3"});
    EXPECT_EQ(top.exit_code, 0) << top.err;
    return nlohmann::json::parse(top.out, nullptr, false);
  }
  /// Asked again, up to five times, until it says so: on a busy computer everybody looks silent now and then.
  [[nodiscard]] test::Outcome top_that_says(const std::string& pattern) const {
    test::Outcome once;
    for (int i = 0; i < 5; ++i) {
      once = railfix({"top", "--once"});
      if (std::regex_search(once.out, std::regex(pattern))) break;
    }
    return once;
  }
  static nlohmann::json find(const nlohmann::json& all, const char* key, const std::string& name) {
    for (const auto& one : all) {
      if (one[key] == name) return one;
    }
    return {};
  }
  std::string train_ = "terminal-" + std::to_string(getpid());
  fs::path folder_ = fs::temp_directory_path() / ("railfix-" + train_);
};

TEST_F(Terminal, TopShowsServicesAndTopics) {
  const Talker talker(train_);
  const auto once = top_that_says("fusion +degraded .*no wheel");
  EXPECT_EQ(once.exit_code, 0) << once.err;
  EXPECT_THAT(once.out, HasSubstr("train " + train_ + ", domain 89"));
  EXPECT_THAT(once.out, ::testing::ContainsRegex("fusion +degraded .*no wheel"));
  EXPECT_THAT(once.out, ::testing::ContainsRegex("train_state +1 "));
  EXPECT_THAT(once.out, Not(HasSubstr("\x1b"))) << "no colours where no terminal is";
  const auto json = top();
  EXPECT_EQ(find(json["services"], "service", "fusion")["host"], "cab");
  const auto states = find(json["topics"], "topic", "train_state");
  EXPECT_GT(states["rate_hz"].get<double>(), 0);
  EXPECT_GT(states["bytes_per_s"].get<double>(), 0);
}

TEST_F(Terminal, TopTellsTwoHostsServicesOfOneNameApart) {
  const Talker talker(train_, true);
  const auto once = top_that_says("fusion +cab +degraded .*no wheel");
  EXPECT_EQ(once.exit_code, 0) << once.err;
  EXPECT_THAT(once.out, ::testing::ContainsRegex("service +host +state"));
  EXPECT_THAT(once.out, ::testing::ContainsRegex("fusion +cab +degraded .*no wheel"));
  EXPECT_THAT(once.out, ::testing::ContainsRegex("fusion +coach +ready .*stands by"));
}

TEST_F(Terminal, TopTellsWhoHasFallenSilent) {
  test::Program recorder(
      test::with_settings("railfix-recorder", {"common.train_id=" + train_, "common.domain=" + kDomain,
                                               "recorder.folder=" + folder_.string(), "recorder.keep_free_mb=0"}),
      {folder_ / "recorder.log", {}, {}});
  messaging::Participant participant(test::network(train_, std::stoi(kDomain)));
  messaging::Queue queue;
  uint32_t partners = 0;
  int heard = 0;
  messaging::Reader<msg::ServiceStatus> statuses(participant, topics::service_status, "", queue,
                                                 [&](const msg::ServiceStatus& status) {
                                                   partners = status.matches();
                                                   ++heard;
                                                 });
  const auto until = [&](const auto& condition) { return test::run_until(queue, condition); };
  ASSERT_TRUE(until([&] { return heard >= 8; }));
  const uint32_t partners_before = partners;
  test::Program top({"railfix", "top", "--json", "--for", "12", "--train", train_, "--domain", kDomain},
                    {folder_ / "top.json", folder_ / "top.err", {}});
  ASSERT_TRUE(until([&] { return partners > partners_before; })) << "top has found the recorder";
  heard = 0;
  ASSERT_TRUE(until([&] { return heard >= 4; }));
  recorder.send(SIGSTOP);
  EXPECT_EQ(top.wait_for_end(), 0) << test::slurp(folder_ / "top.err");
  recorder.send(SIGCONT);
  const auto json = nlohmann::json::parse(test::slurp(folder_ / "top.json"));
  EXPECT_EQ(find(json["services"], "service", "recorder")["state"], "silent");
  EXPECT_EQ(recorder.end(SIGTERM), 0);
}

TEST_F(Terminal, SaysWhatIsWrongWithATime) {
  for (const char* wrong : {"-1", "soon"}) {
    const auto top = railfix({"top", "--once", "--for", wrong});
    EXPECT_EQ(top.exit_code, 2);
    EXPECT_THAT(top.err, HasSubstr(std::string(wrong) + " is not a number of seconds from 0 on"));
  }
}

TEST_F(Terminal, TopSaysWhenNobodyIsThere) {
  const auto top = railfix({"top", "--once", "--for", "1"});
  EXPECT_EQ(top.exit_code, 1);
  EXPECT_THAT(top.err, AllOf(HasSubstr(", without certificates; is a train running there?"), HasSubstr("--config")));
}

TEST_F(Terminal, BandwidthAndDelayOfATopic) {
  const Talker talker(train_);
  const auto bw = railfix({"topics", "bw", "train_state", "--count", "20", "--for", "30", "--json"});
  ASSERT_EQ(bw.exit_code, 0) << bw.err;
  const auto bytes = nlohmann::json::parse(bw.out);
  EXPECT_EQ(bytes["smallest_bytes"], messaging::serialize(msg::TrainState()).size());
  EXPECT_GT(bytes["bytes_per_s"].get<double>(), 0);
  const auto delay = railfix({"topics", "delay", "train_state", "--count", "20", "--for", "30", "--json"});
  ASSERT_EQ(delay.exit_code, 0) << delay.err;
  const auto ms = nlohmann::json::parse(delay.out);
  EXPECT_GE(ms["since_grabbed"]["p50_ms"].get<double>(), 30);
  EXPECT_LE(ms["on_the_way"]["p50_ms"].get<double>(), ms["since_grabbed"]["p50_ms"].get<double>() - 30);
  const auto text = railfix({"topics", "delay", "log_record", "--count", "20", "--for", "30"});
  EXPECT_THAT(text.out, HasSubstr("on the way p50"));
  EXPECT_THAT(text.out, Not(HasSubstr("since the grab"))) << "a log record has no picture behind it";
}

TEST_F(Terminal, LogFollowsWithAFilter) {
  const Talker talker(train_);
  const auto all = railfix({"log", "-f", "--for", "4"});
  EXPECT_EQ(all.exit_code, 0) << all.err;
  EXPECT_THAT(all.out, HasSubstr("fusion info: goes on"));
  EXPECT_THAT(all.out, HasSubstr("odometry error: camera is blind"));
  const auto some = railfix({"log", "-f", "--for", "4", "--service", "fusion", "--level", "warning"});
  EXPECT_THAT(some.out, HasSubstr("fusion warning: wheel slides"));
  EXPECT_THAT(some.out, Not(HasSubstr("goes on")));
  EXPECT_THAT(some.out, Not(HasSubstr("odometry")));
  const auto neither = railfix({"log"});
  EXPECT_EQ(neither.exit_code, 2);
  EXPECT_THAT(neither.err, HasSubstr("give a recording, or -f"));
}

TEST_F(Terminal, WhatIsNoUtf8DoesNotEndALogAsJson) {
  const Talker talker(train_);
  const auto log = railfix({"log", "-f", "--for", "4", "--json", "--service", "recorder"});
  EXPECT_EQ(log.exit_code, 0) << log.err;
  EXPECT_EQ(nlohmann::json::parse(log.out.substr(0, log.out.find('\n')), nullptr, false)["text"], "cut off \uFFFD");
}

}  // namespace
}  // namespace railfix
