// One service that does not end keeps the supervisor from nothing else.
#include "train/supervise.hpp"

#include <gmock/gmock.h>
#include <poll.h>
#include <signal.h>
#include <sys/ptrace.h>
#include <sys/wait.h>

#include <algorithm>
#include <cerrno>
#include <fstream>

#include "core/time.hpp"
#include "service/health_file.hpp"
#include "support/program.hpp"
#include "train/left_behind.hpp"
#include "train/stands_still.hpp"
#include "unit/train_tools/train_folder.hpp"

namespace railfix::tool {
namespace {

using ::testing::HasSubstr;

constexpr const char* kRefusesToEnd = "trap '' TERM; : > \"$0/refuses\"; while :; do sleep 0.1; done";
constexpr const char* kEnds = "while :; do sleep 0.1; done";

class Supervise : public TrainFolder {
 protected:
  void start() {
    supervisor_ = fork();
    if (supervisor_ != 0) return;
    const int log = open(log_.c_str(), O_WRONLY | O_CREAT, 0644);
    dup2(log, STDERR_FILENO);
    supervise(host_);
    _exit(0);
  }
  ~Supervise() override {
    if (supervisor_ == 0) return;
    kill(supervisor_, SIGKILL);
    waitpid(supervisor_, nullptr, 0);
    for (const pid_t pid : processes()) {  // services outlive their supervisor
      const auto command = command_of(pid);
      if (std::ranges::find(command, folder_.string()) != command.end()) kill(pid, SIGKILL);
    }
  }
  PlannedService service(const std::string& name, int generation, const char* script) const {
    PlannedService one;
    one.name = name;
    one.generation = generation;
    one.command = {"/bin/sh", "-c", script, folder_.string()};
    return one;
  }
  void plan(const std::vector<PlannedService>& services) {
    HostPlan plan;
    plan.train_id = folder_.filename();
    plan.host = "cab";
    plan.services = services;
    ASSERT_TRUE(host_.write(plan).ok());
  }
  RunningService of(const std::string& key) const {
    const auto state = host_.state();
    const auto found = state.find(key);
    return found == state.end() ? RunningService{} : found->second;
  }
  /// What runs kRefusesToEnd does so from now on.
  bool refuses() const { return fs::exists(folder_ / "refuses"); }
  bool runs(const std::string& name, int generation) const {
    const auto service = of(name);
    return service.runs() && service.generation == generation;
  }
  template <class Condition>
  static bool within_s(double seconds, Condition condition) {
    const int64_t deadline_ns = core::monotonic_ns() + core::to_ns(seconds);
    while (!condition()) {
      if (core::monotonic_ns() > deadline_ns) return false;
      poll(nullptr, 0, 10);
    }
    return true;
  }
  /// The sensor_gateway comes back while this still holds.
  template <class Condition>
  void expect_watched_while(Condition holds, const std::string& when) {
    const auto before = of("sensor_gateway");
    ASSERT_GT(before.pid, 1) << when;
    ASSERT_EQ(kill(static_cast<pid_t>(before.pid), SIGKILL), 0) << when;
    EXPECT_TRUE(within_s(8, [&] {  // one that is asked to end has 10 s
      const auto now = of("sensor_gateway");
      return now.runs() && now.pid != before.pid;
    })) << when;
    EXPECT_TRUE(holds()) << when;
  }
  [[nodiscard]] bool supervisor_has(const std::vector<std::string>& child) const {
    return std::ranges::any_of(processes(),
                               [&](pid_t pid) { return parent_of(pid) == supervisor_ && command_of(pid) == child; });
  }
  const HostFolder host_{folder_};
  const fs::path log_ = folder_ / "supervisor.log";
  pid_t supervisor_ = 0;
};

// A traced process is like one that the kernel holds at a disk: even killed it does not go before the tracer lets it.
TEST_F(Supervise, WhoDoesNotEndEvenWhenKilledKeepsOnlyItsOwnSuccessorWaiting) {
  const auto gateway = service("sensor_gateway", 1, kEnds);
  plan({gateway, service("tpr_publisher", 1, kRefusesToEnd)});
  start();
  ASSERT_TRUE(within_s(60, [&] { return runs("sensor_gateway", 1) && runs("tpr_publisher", 1) && refuses(); }));
  const auto held = static_cast<pid_t>(of("tpr_publisher").pid);
  if (ptrace(PTRACE_SEIZE, held, nullptr, nullptr) != 0) GTEST_SKIP() << "this user may not trace: " << strerror(errno);
  plan({gateway, service("tpr_publisher", 2, kEnds)});
  ASSERT_TRUE(within_s(60, [&] { return of("tpr_publisher before").pid == held; }));
  expect_watched_while([&] { return of("tpr_publisher before").pid == held; }, "one is asked to end");
  EXPECT_EQ(of("tpr_publisher").pid, 0) << "two of a kind";
  EXPECT_THAT(of("tpr_publisher").last_end,
              HasSubstr("waits for process " + std::to_string(held) + " of generation 1"));
  EXPECT_TRUE(within_s(60, [&] { return runs("tpr_publisher", 2); })) << "it cannot do anything any more";
  expect_watched_while([&] { return kill(held, 0) == 0; }, "one that was killed does not go");
  ASSERT_EQ(kill(supervisor_, SIGTERM), 0);
  EXPECT_TRUE(within_s(30, [&] { return waitpid(supervisor_, nullptr, WNOHANG) == supervisor_; }));
  EXPECT_THAT(test::slurp(log_), HasSubstr("tpr_publisher, process " + std::to_string(held) +
                                           ", was killed and does not end: the kernel waits for a disk or a device"));
  waitpid(held, nullptr, __WALL);  // lets it go
}

// It may end for want of that very room.
TEST_F(Supervise, WhatWasLeftInSharedMemoryGoesThoughAServiceEndsAgainAndAgain) {
  const fs::path left = "/dev/shm/fast_datasharing_" + folder_.filename().string();
  std::ofstream(left) << "a picture";
  const auto all_left = left_behind();
  if (std::ranges::find(all_left, left) == all_left.end()) {
    fs::remove(left);
    GTEST_SKIP() << "skipped: this user may not look into every process";
  }
  plan({service("frame_grabber", 1, "exit 2")});
  start();
  EXPECT_TRUE(within_s(60, [&] { return !fs::exists(left); }));
  EXPECT_GT(of("frame_grabber").restarts, 0);
  fs::remove(left);
}

TEST_F(Supervise, AnEngineThatHangsKeepsOnlyItsOwnServiceWaiting) {
  const auto gateway = service("sensor_gateway", 1, kEnds);
  auto contained = service("tpr_publisher", 1, kRefusesToEnd);
  plan({gateway, contained});
  start();
  ASSERT_TRUE(within_s(60, [&] { return runs("sensor_gateway", 1) && runs("tpr_publisher", 1) && refuses(); }));
  kill(supervisor_, SIGKILL);
  waitpid(supervisor_, nullptr, 0);
  contained.clean_up = {"/bin/sleep", "1000"};  // its start would hang, too
  plan({gateway, contained});
  start();
  ASSERT_TRUE(within_s(60, [&] { return test::slurp(log_).find("goes on with tpr_publisher") != std::string::npos; }));
  plan({gateway, service("tpr_publisher", 2, kEnds)});
  ASSERT_TRUE(within_s(60, [&] { return supervisor_has(contained.clean_up); }));
  expect_watched_while([&] { return supervisor_has(contained.clean_up); }, "the engine removes a container");
  EXPECT_TRUE(within_s(60, [&] { return runs("tpr_publisher", 2); }));
  EXPECT_FALSE(supervisor_has(contained.clean_up)) << "it would remove the next one";
}

// It may die before the new one has said a word: that must not be looked for under the wrong name for ever.
TEST_F(Supervise, ASuccessorTakesThePlaceOfOneThatDiesHoweverLongItTakesToSpeak) {
  service::CommonConfig common;
  common.train_id = folder_.filename();
  common.host = "cab";
  const auto said = service::health_path(common, "fusion").string();
  const std::string speaks_late = "sleep 2; echo 1 2 > " + said + "-beside; " + kEnds;
  plan({service("fusion", 1, kEnds)});
  start();
  ASSERT_TRUE(within_s(60, [&] { return runs("fusion", 1); }));
  const auto before = static_cast<pid_t>(of("fusion").pid);
  plan({service("fusion", 2, speaks_late.c_str())});
  ASSERT_TRUE(within_s(60, [&] { return runs("fusion", 2); }));
  const auto successor = of("fusion").pid;
  ASSERT_EQ(kill(before, SIGKILL), 0);
  EXPECT_TRUE(within_s(60, [&] { return fs::exists(said); }));
  EXPECT_FALSE(fs::exists(said + "-beside"));
  EXPECT_EQ(of("fusion").pid, successor);
  fs::remove(said);
}

}  // namespace
}  // namespace railfix::tool
