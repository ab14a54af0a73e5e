// A train comes up, goes down, is changed, and survives its supervisor.
#include <arpa/inet.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <signal.h>
#include <sys/socket.h>

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
  void write_manifest(const std::string& release, const std::string& more = "") {
    std::ofstream(folder_ / "train" / "train.yaml")
        << "train:\n  id: " << id_ << "\n  domain: 95\n  release: " << release
        << "\n  run_as: programs\n  hosts: { cab: { address: 127.0.0.1 } }\n"
           "  services: { fusion: cab, tpr_publisher: cab }\n"
           "settings: { common: { log_level: warning }"
        << more << " }\n";
  }
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
  EXPECT_THAT(after.out, HasSubstr("down: railfix train up"));
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

  // A release whose fusion does not live.
  const auto bin = folder_ / "root/opt/railfix/9.9.9/bin";
  fs::create_directories(bin);
  std::ofstream(bin / "railfix-fusion") << "#!/bin/sh\ncase \"$*\" in *--check*) exit 0 ;; esac\nexit 3\n";
  fs::permissions(bin / "railfix-fusion", fs::perms::owner_all);
  fs::create_symlink(fs::path(RAILFIX_BIN_DIR) / "railfix-tpr-publisher", bin / "railfix-tpr-publisher");
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

// What no check can know, such as a camera that another program has: the service ends with exit code 2, again and
// again.
TEST_F(Fleet, AServiceThatRefusesItsConfigurationIsNotWaitedFor) {
  const auto bin = folder_ / "root/opt/railfix/9.9.9/bin";
  fs::create_directories(bin);
  const auto script = [&](const std::string& program, const std::string& does) {
    std::ofstream(bin / program) << "#!/bin/sh\ncase \"$*\" in *--check*) exit 0 ;; esac\n" << does;
    fs::permissions(bin / program, fs::perms::owner_all);
  };
  fs::create_symlink(fs::path(RAILFIX_BIN_DIR) / "railfix-tpr-publisher", bin / "railfix-tpr-publisher");
  const auto seconds = [](const auto& work) {
    const int64_t begun_ns = core::monotonic_ns();
    work();
    return core::seconds(core::monotonic_ns() - begun_ns);
  };
  script("railfix-fusion", "echo 'fusion: the wheel has no pulses' >&2\nexit 2\n");
  write_manifest("9.9.9");
  test::Outcome refused;
  EXPECT_LT(seconds([&] { refused = up(); }), 30);
  EXPECT_EQ(refused.exit_code, 1);
  EXPECT_EQ(refused.err,
            "railfix: not healthy: fusion does not run: ended with exit code 2: fusion: the wheel has no pulses\n");

  // One that is only slow is told while it is waited for.
  ASSERT_EQ(train({"down", "--root", root()}).exit_code, 0);
  script("railfix-fusion", "exec sleep 100\n");
  const auto slow = train({"up", manifest(), "--root", root(), "--healthy-for", "1", "--patience", "8"});
  EXPECT_EQ(slow.exit_code, 1);
  EXPECT_THAT(slow.out, HasSubstr("waiting: fusion does not run here"));

  // An upgrade to it goes back at once.
  ASSERT_EQ(train({"down", "--root", root()}).exit_code, 0);
  write_manifest(RAILFIX_TEST_RELEASE);
  ASSERT_EQ(up().exit_code, 0);
  script("railfix-fusion", "echo 'fusion: the wheel has no pulses' >&2\nexit 2\n");
  write_manifest("9.9.9");
  EXPECT_LT(seconds([&] { refused = upgrade(); }), 30);
  EXPECT_THAT(refused.err,
              HasSubstr("did not pass: fusion does not run: ended with exit code 2: fusion: the wheel has"));
  EXPECT_THAT(refused.err, HasSubstr("runs again"));
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

TEST_F(Fleet, AUserWithoutRightsIsToldHowItIsAndChangesNothing) {
  if (geteuid() != 0) GTEST_SKIP() << "needs root, to be somebody else";
  ASSERT_EQ(up().exit_code, 0);
  const auto as_nobody = [&](std::vector<std::string> arguments) {
    arguments.insert(arguments.begin(), {"/usr/bin/setpriv", "--reuid=65534", "--regid=65534", "--clear-groups",
                                         RAILFIX_BIN_DIR "/railfix", "train"});
    arguments.insert(arguments.end(), {"--root", root()});
    return test::run_program(arguments, 60);
  };
  if (as_nobody({"status", "--help"}).exit_code != 0) GTEST_SKIP() << "this build's folder is not for everybody";
  const auto told = as_nobody({"status"});
  EXPECT_EQ(told.exit_code, 0) << told.out << told.err;
  EXPECT_THAT(told.out, Not(HasSubstr("without supervisor")));
  const auto refusal = "railfix: only root, or who may write to " + root() +
                       "/var/lib/railfix-train, changes what runs here; use sudo\n";
  for (const auto& change :
       {std::vector<std::string>{"up", manifest()}, {"upgrade", manifest()}, {"rollback"}, {"down"}}) {
    const auto refused = as_nobody(change);
    EXPECT_EQ(refused.exit_code, 2);
    EXPECT_EQ(refused.err, refusal);
    EXPECT_EQ(refused.out, "");
  }
}

TEST_F(Fleet, TheFolderOfAnotherTrainChangesNothing) {
  ASSERT_EQ(up().exit_code, 0);
  const auto before = status();
  const auto other = folder_ / "other";
  fs::create_directories(other);
  auto text = test::slurp(folder_ / "train/train.yaml");
  text.replace(text.find("id: " + id_), 4 + id_.size(), "id: " + id_ + "-other");
  std::ofstream(other / "train.yaml") << text;
  const auto refusal = "this computer runs train " + id_ + "; " + other.string() + " is of train " + id_ +
                       "-other: railfix train down --root " + root() + " first, then railfix train up " +
                       other.string() + " --root " + root();
  for (const char* verb : {"diff", "up", "upgrade"}) {
    const auto refused = train({verb, other.string(), "--root", root()});
    EXPECT_EQ(refused.exit_code, 2) << verb;
    EXPECT_EQ(refused.err, "railfix: " + refusal + "\n");
    EXPECT_EQ(refused.out, "");
  }
  const auto checked = train({"check", other.string(), "--root", root()});
  EXPECT_EQ(checked.exit_code, 1);
  EXPECT_THAT(checked.out, HasSubstr("error: " + refusal));
  EXPECT_EQ(status("fusion")["pid"], before["services"][0]["pid"]);
  ASSERT_EQ(train({"down", "--root", root()}).exit_code, 0);
  EXPECT_THAT(train({"diff", other.string(), "--root", root()}).err, HasSubstr("was here before, and is down"));
  const auto started = train({"up", other.string(), "--root", root(), "--healthy-for", "1", "--patience", "60"});
  EXPECT_EQ(started.exit_code, 0) << started.out << started.err;
  EXPECT_THAT(train({"rollback", "--root", root()}).err, HasSubstr("there is no generation before 2"));
}

TEST_F(Fleet, AMistakeInTheManifestStartsNothing) {
  write_manifest("0.0.7");
  const auto missing = up();
  EXPECT_EQ(missing.exit_code, 1);
  EXPECT_THAT(missing.out, HasSubstr("error: release 0.0.7 of fusion is not installed on this computer"));
  const auto checked = train({"check", manifest(), "--root", root()});
  EXPECT_EQ(checked.exit_code, 1);
  EXPECT_THAT(checked.out, HasSubstr("error: release 0.0.7 of fusion is not installed on this computer"));
  write_manifest(RAILFIX_TEST_RELEASE, ", fusion: { no_such_key: 1 }");
  const auto wrong = up();
  EXPECT_EQ(wrong.exit_code, 1);
  EXPECT_THAT(wrong.out, HasSubstr((folder_ / "train/train.yaml").string() +
                                   " line 8: fusion.no_such_key is not a key of this section"));
  EXPECT_EQ(train({"status", "--root", root()}).exit_code, 2) << "something was started";
}

TEST_F(Fleet, ThePageIsSaidWhereItIsAndNotWhereItWasToBe) {
  const int other = socket(AF_INET, SOCK_STREAM, 0);
  sockaddr_in at{};
  at.sin_family = AF_INET;
  at.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  socklen_t bytes = sizeof(at);
  ASSERT_EQ(bind(other, reinterpret_cast<const sockaddr*>(&at), bytes), 0);
  ASSERT_EQ(listen(other, 1), 0);
  ASSERT_EQ(getsockname(other, reinterpret_cast<sockaddr*>(&at), &bytes), 0);
  const auto port = std::to_string(ntohs(at.sin_port));
  std::ofstream(folder_ / "train" / "train.yaml")
      << "train:\n  id: " << id_ << "\n  domain: 95\n  release: " RAILFIX_TEST_RELEASE
      << "\n  run_as: programs\n  hosts: { cab: { address: 127.0.0.1 } }\n  services: { monitor: cab }\n"
         "settings: { common: { log_level: error }, monitor: { foxglove_port: 0, port: "
      << port << " } }\n";
  const auto started = up();
  EXPECT_EQ(started.exit_code, 0) << started.out << started.err;
  EXPECT_THAT(started.out, HasSubstr("warning: settings.monitor.port: " + port + " is taken on this computer"));
  EXPECT_THAT(started.out, HasSubstr("the page is at http://127.0.0.1:"));
  EXPECT_THAT(started.out, Not(HasSubstr("the page is at http://127.0.0.1:" + port + "/")));
  const auto page = status()["page"].get<std::string>();
  EXPECT_THAT(train({"status", "--root", root()}).out, HasSubstr("the page is at " + page + "\n"));
  const auto own = page.substr(page.rfind(':') + 1);
  auto text = test::slurp(folder_ / "train/train.yaml");
  text.replace(text.rfind(port), port.size(), own.substr(0, own.size() - 1));
  std::ofstream(folder_ / "train/train.yaml") << text;
  EXPECT_THAT(train({"check", manifest(), "--root", root()}).out, Not(HasSubstr("is taken on this computer")));
  close(other);
}

TEST_F(Fleet, CheckSaysWhichComputersItHasNotAsked) {
  const auto check_with = [&](const std::string& hosts, const std::string& host) {
    std::ofstream(folder_ / "train/train.yaml")
        << "train:\n  id: " << id_ << "\n  release: " RAILFIX_TEST_RELEASE "\n  run_as: programs\n  hosts: { " << hosts
        << " }\n  services: { fusion: cab, tpr_publisher: cab }\n";
    return train({"check", manifest(), "--host", host});
  };
  EXPECT_THAT(check_with("cab: { address: 127.0.0.1 }", "cab").out, Not(HasSubstr("not asked")));
  const auto two = check_with("cab: { address: 127.0.0.1 }, coach: { address: 10.99.1.12 }", "cab");
  EXPECT_EQ(two.exit_code, 0) << two.out << two.err;
  EXPECT_THAT(two.out, HasSubstr("not asked: the computer coach "));
  EXPECT_THAT(two.out, HasSubstr("ssh 10.99.1.12 railfix train check TRAIN"));
  EXPECT_THAT(two.out, Not(HasSubstr("the computer cab ")));
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
