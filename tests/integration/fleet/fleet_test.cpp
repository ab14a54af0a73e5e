// A train comes up, goes down, is changed, and survives its supervisor.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <signal.h>

#include <algorithm>
#include <atomic>
#include <thread>

#include "integration/fleet/fleet_train.hpp"
#include "messaging/topics.hpp"
#include "support/network.hpp"

namespace railfix {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

class Fleet : public FleetTest {
 protected:
  /// Of this train.
  int processes_of(std::string service) const {
    std::ranges::replace(service, '_', '-');
    int count = 0;
    for (const auto& process : fs::directory_iterator("/proc")) {
      if (!lives(static_cast<pid_t>(std::atoll(process.path().filename().c_str())))) continue;
      const auto command = test::slurp(process.path() / "cmdline");
      const bool is_it = command.substr(0, command.find('\0')).ends_with("/railfix-" + service);
      if (is_it && command.find(root()) != std::string::npos) ++count;
    }
    return count;
  }
  Fleet() { write_manifest(RAILFIX_TEST_RELEASE); }
};

TEST_F(Fleet, ServicesComeUpComeBackAfterAKillAndGoDown) {
  const auto started = up();
  EXPECT_EQ(started.exit_code, 0) << started.out << started.err;
  const auto heard = folder_ / "heard";
  test::Program log({"railfix", "log", "-f", "--root", root()}, {heard, {}, {}});  // finds the train by itself
  const auto is_told = [&](const std::string& end) {
    return wait_until(
        [&] { return test::slurp(heard).find("started again: the process before " + end) != std::string::npos; });
  };
  const auto before = status("fusion");
  EXPECT_TRUE(before["healthy"]);
  ASSERT_GT(before["pid"].get<pid_t>(), 1);  // kill(0) would end this test
  EXPECT_THAT(test::slurp("/proc/" + std::to_string(before["pid"].get<pid_t>()) + "/environ"),
              HasSubstr("RAILFIX_TRAIN_FOLDER=" + manifest()))
      << "its advice would lack the folder";
  ASSERT_EQ(kill(before["pid"].get<pid_t>(), SIGKILL), 0);
  EXPECT_TRUE(wait_until([&] {
    const auto now = status("fusion");
    return now["healthy"] && now["pid"] != before["pid"] && now["restarts"] == 1;
  }));
  EXPECT_TRUE(is_told("ended by Killed")) << "the train does not hear of it: " << test::slurp(heard);
  const auto again = status("fusion");
  ASSERT_GT(again["pid"].get<pid_t>(), 1);
  ASSERT_EQ(kill(again["pid"].get<pid_t>(), SIGSTOP), 0);
  EXPECT_TRUE(wait_until([&] {
    const auto now = status("fusion");
    return now["healthy"] && now["pid"] != again["pid"] && now["restarts"] == 2;
  })) << "one that hangs is not started anew";
  EXPECT_TRUE(is_told("was frozen, ended by Killed")) << test::slurp(heard);
  const auto last = status("fusion");
  ASSERT_GT(last["pid"].get<pid_t>(), 1);
  ASSERT_EQ(kill(last["pid"].get<pid_t>(), SIGKILL), 0);
  EXPECT_EQ(train({"down", "--root", root()}).exit_code, 0);
  EXPECT_THAT(in_memory("health"), ::testing::IsEmpty()) << "left behind";
  const auto after = train({"status", "--root", root()});
  EXPECT_EQ(after.exit_code, 1);
  EXPECT_THAT(after.out, HasSubstr("down: railfix train up " + manifest() + " --root " + root()));
}

// The kernel may take the supervisor when memory is short: the train goes on, and the next one looks after it.
TEST_F(Fleet, ServicesOutliveTheirSupervisorAndTheNextOneGoesOnWithThem) {
  ASSERT_EQ(up().exit_code, 0);
  const auto fusion = status("fusion");
  const auto lock = folder_ / "root/var/lib/railfix-train/supervisor.lock";
  const auto kill_supervisor = [&] {
    const auto pid = static_cast<pid_t>(std::stoll(test::slurp(lock)));
    ASSERT_GT(pid, 1);
    ASSERT_EQ(kill(pid, SIGKILL), 0);
    ASSERT_TRUE(wait_until([&] { return !lives(pid); }));
  };
  kill_supervisor();
  EXPECT_THAT(train({"status", "--root", root()}).out, HasSubstr("without supervisor"));
  const auto again = up();
  EXPECT_EQ(again.exit_code, 0) << again.out << again.err;
  EXPECT_THAT(again.out, HasSubstr("without a supervisor: it is started"));
  EXPECT_EQ(status("fusion")["pid"], fusion["pid"]);
  EXPECT_FALSE(fs::exists(folder_ / "root/var/lib/railfix-train/generations/2")) << "nothing was installed";
  ASSERT_GT(fusion["pid"].get<pid_t>(), 1);
  ASSERT_EQ(kill(fusion["pid"].get<pid_t>(), SIGKILL), 0);
  EXPECT_TRUE(wait_until([&] {
    const auto now = status("fusion");
    return now["healthy"] && now["pid"] != fusion["pid"];
  })) << "nobody looks after it";
  kill_supervisor();
  const auto orphan = status("fusion")["pid"].get<pid_t>();
  EXPECT_EQ(train({"down", "--root", root()}).exit_code, 0);
  ASSERT_GT(orphan, 1);
  EXPECT_FALSE(lives(orphan)) << "down ends what has no supervisor";
}

// A disk that has damaged the supervisor's notes must not give the train two fusions.
TEST_F(Fleet, ANewSupervisorFindsTheServicesWithoutTheNotesOfTheOneBefore) {
  ASSERT_EQ(up().exit_code, 0);
  const auto before = status();
  const auto home = folder_ / "root/var/lib/railfix-train";
  const auto kill_supervisor = [&] {
    const auto pid = static_cast<pid_t>(std::stoll(test::slurp(home / "supervisor.lock")));
    ASSERT_GT(pid, 1);
    ASSERT_EQ(kill(pid, SIGKILL), 0);
    ASSERT_TRUE(wait_until([&] { return !lives(pid); }));
  };
  const auto expect_same = [&](const std::string& how) {
    for (const auto& service : before["services"]) {
      const auto now = status(service["service"]);
      EXPECT_EQ(now["pid"], service["pid"]) << how;
      EXPECT_TRUE(now["healthy"]) << now;
      EXPECT_EQ(processes_of(service["service"]), 1) << how;
    }
  };
  kill_supervisor();
  const auto fusion = before["services"][0];
  ASSERT_EQ(fusion["service"], "fusion");
  std::vector<std::string> command;
  std::istringstream words(test::slurp("/proc/" + std::to_string(fusion["pid"].get<pid_t>()) + "/cmdline"));
  for (std::string word; std::getline(words, word, '\0');) command.push_back(word);
  const test::Program second(command, {folder_ / "second.log", {}, {}});
  ASSERT_TRUE(wait_until([&] { return processes_of("fusion") == 2; }));
  std::ofstream(home / "state.yaml") << "fusion: {pid: [";
  EXPECT_THAT(train({"status", "--root", root()}).err, HasSubstr("state.yaml is damaged (yaml-cpp: error at line 1"));
  {
    test::Program systemds({"railfix", "train", "supervise", "--root", root()}, {folder_ / "supervisor.log", {}, {}});
    EXPECT_TRUE(wait_until([&] { return test::slurp(home / "state.yaml").find("born") != std::string::npos; }));
    EXPECT_THAT(test::slurp(folder_ / "supervisor.log"), HasSubstr("ends a second fusion"));
    EXPECT_TRUE(wait_until([&] { return processes_of("fusion") == 1; }));
    expect_same("of another supervisor, with a damaged file");
  }
  fs::remove(home / "state.yaml");
  const auto again = up();
  EXPECT_EQ(again.exit_code, 0) << again.out << again.err;
  EXPECT_THAT(again.out, HasSubstr("without a supervisor: it is started"));
  expect_same("of railfix train up, without the file");
  kill_supervisor();
  fs::remove(home / "state.yaml");
  EXPECT_EQ(train({"down", "--root", root()}).exit_code, 0);
  for (const auto& service : before["services"]) EXPECT_EQ(processes_of(service["service"]), 0);
}

// A wheel that turns, on this train's network, until the end.
class Wheel {
 public:
  explicit Wheel(const std::string& train) : participant_(options(train)) {}
  ~Wheel() {
    ended_ = true;
    thread_.join();
  }

 private:
  static messaging::ParticipantOptions options(const std::string& train) {
    auto options = test::network(train, 95);
    options.interfaces = {"127.0.0.1"};
    return options;
  }
  void turn() {
    msg::WheelSample sample;
    sample.pulses_per_metre(100);
    for (; !ended_; poll(nullptr, 0, 50)) {
      sample.stamp_ns(core::wall_ns());
      sample.grabbed_ns(sample.stamp_ns());
      sample.seq(sample.seq() + 1);
      sample.pulses(sample.pulses() + 50);
      writer_.write(sample);
    }
  }
  messaging::Participant participant_;
  messaging::Writer<msg::WheelSample> writer_{participant_, messaging::topics::wheel_sample};
  std::atomic<bool> ended_ = false;
  std::thread thread_{[this] { turn(); }};
};

TEST_F(Fleet, AnUpgradeThatSilencesAServiceIsRolledBack) {
  ASSERT_EQ(up().exit_code, 0);
  const Wheel wheel(id_);
  EXPECT_TRUE(wait_until([&] {
    return status("fusion")["text"].get<std::string>().find("last output 0.") != std::string::npos;
  })) << status("fusion");
  const auto before = status("fusion");
  write_manifest(RAILFIX_TEST_RELEASE, ", fusion: { use_wheel: false }");
  const auto failed = upgrade("12");
  EXPECT_EQ(failed.exit_code, 1) << failed.out << failed.err;
  EXPECT_THAT(failed.err, HasSubstr("did not pass: fusion sends nothing, and did before"));
  EXPECT_THAT(failed.err, HasSubstr("runs again"));
  EXPECT_EQ(status("fusion")["generation"], before["generation"]);
  write_manifest(RAILFIX_TEST_RELEASE, ", fusion: { use_gnss: false }");
  const auto passed = upgrade();
  EXPECT_EQ(passed.exit_code, 0) << passed.out << passed.err;
}

TEST_F(Fleet, AnUpgradeRestartsWhatChangedAndRollsBackByItselfWhenItIsBad) {
  ASSERT_EQ(up().exit_code, 0);
  const auto fusion = status("fusion");
  const auto reports = status("tpr_publisher");
  write_manifest(RAILFIX_TEST_RELEASE, ", tpr_publisher: { nid_engine: 4711 }");
  const auto difference = train({"diff", manifest(), "--root", root()});
  EXPECT_THAT(difference.out, HasSubstr("+tpr_publisher.nid_engine: 4711"));
  EXPECT_THAT(difference.out, Not(HasSubstr("fusion:")));
  const auto upgraded = upgrade();
  EXPECT_EQ(upgraded.exit_code, 0) << upgraded.out << upgraded.err;
  EXPECT_EQ(status("fusion")["pid"], fusion["pid"]) << "it was not concerned";
  const auto changed = status("tpr_publisher");
  EXPECT_NE(changed["pid"], reports["pid"]);

  install_dead_release();
  write_manifest("9.9.9", ", tpr_publisher: { nid_engine: 4711 }");
  const auto failed = upgrade("6");
  EXPECT_EQ(failed.exit_code, 1);
  EXPECT_THAT(failed.err, HasSubstr("did not pass: fusion does not run: ended with exit code 3"));
  EXPECT_THAT(failed.err, HasSubstr("runs again"));
  EXPECT_EQ(status("fusion")["release"], RAILFIX_TEST_RELEASE);
  EXPECT_TRUE(status("fusion")["healthy"]);
  EXPECT_EQ(status("tpr_publisher")["pid"], changed["pid"]) << "its turn had not come";

  const auto back = train({"rollback", "--root", root(), "--healthy-for", "1", "--patience", "60"});
  EXPECT_EQ(back.exit_code, 0) << back.out << back.err;
  EXPECT_EQ(status("tpr_publisher")["generation"], reports["generation"]);
}

TEST_F(Fleet, ARollbackGoesFurtherBackAndNeverToWhatItCameFrom) {
  ASSERT_EQ(up().exit_code, 0);
  for (const char* engine : {"4711", "4712"}) {
    write_manifest(RAILFIX_TEST_RELEASE, std::string(", tpr_publisher: { nid_engine: ") + engine + " }");
    ASSERT_EQ(upgrade().exit_code, 0);
  }
  const auto back = [&] { return train({"rollback", "--root", root(), "--healthy-for", "1", "--patience", "60"}); };
  EXPECT_THAT(back().out, HasSubstr("generation 2 runs again"));
  EXPECT_THAT(back().out, HasSubstr("generation 1 runs again"));
  const auto end = back();
  EXPECT_EQ(end.exit_code, 2);
  EXPECT_THAT(end.err, HasSubstr("there is no generation before 1; railfix train upgrade "));
  ASSERT_EQ(upgrade().exit_code, 0);
  EXPECT_THAT(back().out, HasSubstr("generation 1 runs again"));
}

TEST_F(Fleet, DownAndUpKeepTheWayBack) {
  ASSERT_EQ(up().exit_code, 0);
  write_manifest(RAILFIX_TEST_RELEASE, ", tpr_publisher: { nid_engine: 4711 }");
  ASSERT_EQ(upgrade().exit_code, 0);
  ASSERT_EQ(train({"down", "--root", root()}).exit_code, 0);
  ASSERT_EQ(up().exit_code, 0);
  const auto back = train({"rollback", "--root", root(), "--healthy-for", "1", "--patience", "60"});
  EXPECT_THAT(back.out, HasSubstr("generation 1 runs again")) << back.err;
}

TEST_F(Fleet, WhatIsTakenDownWhileAnUpgradeWaitsStaysDown) {
  ASSERT_EQ(up().exit_code, 0);
  install_dead_release();
  write_manifest("9.9.9");
  const auto said = folder_ / "upgrade.log";
  test::Program upgrade(
      {"railfix", "train", "upgrade", manifest(), "--root", root(), "--healthy-for", "1", "--patience", "15"},
      test::Program::Options{said, {}, {}});
  ASSERT_TRUE(wait_until([&] { return status("fusion")["release"] == "9.9.9"; }));
  EXPECT_EQ(train({"down", "--root", root()}).exit_code, 0);
  ASSERT_TRUE(wait_until([&] { return upgrade.exit_code().has_value(); }));
  EXPECT_EQ(upgrade.exit_code(), 1);
  EXPECT_THAT(test::slurp(said), HasSubstr("another command has changed what runs here meanwhile"));
  EXPECT_THAT(test::slurp(fs::path(root()) / "var/lib/railfix-train/plan.yaml"), HasSubstr("down: true"));
}

// A fusion that was started beside another one has taken its place, and its file in the host's memory another name.
TEST_F(Fleet, AfterAnUpgradeDownLeavesNothingBehind) {
  ASSERT_EQ(up().exit_code, 0);
  write_manifest(RAILFIX_TEST_RELEASE, ", fusion: { use_gnss: false }");
  const auto upgraded = upgrade();
  ASSERT_EQ(upgraded.exit_code, 0) << upgraded.out << upgraded.err;
  EXPECT_EQ(in_memory("health").size(), 2U);
  EXPECT_EQ(train({"down", "--root", root()}).exit_code, 0);
  EXPECT_THAT(in_memory("health"), ::testing::IsEmpty());
}

// The lines of the page work as they stand there.
TEST(FleetPage, AThirdTrainIsMadeStepByStep) {
  const auto page = test::slurp(fs::path(RAILFIX_SOURCE_DIR) / "docs" / "fleet.md");
  const auto section = page.substr(page.find("## A train of your own"));
  std::string script = "set -e\nexport PATH=" RAILFIX_BIN_DIR ":$PATH\n";
  for (size_t begin = section.find("```sh\n"); begin != std::string::npos; begin = section.find("```sh\n", begin)) {
    begin += 6;
    script += section.substr(begin, section.find("```", begin) - begin);
  }
  const auto folder = fs::temp_directory_path() / ("railfix-fleet-page-" + std::to_string(getpid()));
  fs::create_directories(folder);
  std::ofstream(folder / "page.sh") << "cd " << folder.string() << "\ntrap 'railfix train down --root host' EXIT\n"
                                    << script;
  const auto ran = test::run_program({"/bin/bash", (folder / "page.sh").string()}, 300);
  EXPECT_EQ(ran.exit_code, 0) << ran.out << ran.err;
  EXPECT_THAT(ran.out, HasSubstr("train vt612-003, host cab"));
  EXPECT_THAT(ran.out, HasSubstr("+tpr_publisher.nid_engine: 612303"));
  EXPECT_THAT(ran.out, HasSubstr("generation 1 runs again"));
  fs::remove_all(folder);
}

}  // namespace
}  // namespace railfix
