// Commands that are typed at the same time, and one that is ended with Ctrl-C.
#include <gmock/gmock.h>

#include "integration/fleet/fleet_train.hpp"

namespace railfix {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::MatchesRegex;
using ::testing::Not;

class AtOnce : public FleetTest {
 protected:
  AtOnce() { write_manifest(RAILFIX_TEST_RELEASE); }
  /// 9.9.8, whose fusion never says anything.
  void install_silent_release() {
    const auto bin = folder_ / "root/opt/railfix/9.9.8/bin";
    fs::create_directories(bin);
    std::ofstream(bin / "railfix-fusion")
        << "#!/bin/sh\ncase \"$*\" in *--check*) exit 0 ;; esac\nwhile :; do sleep 0.1; done\n";
    fs::permissions(bin / "railfix-fusion", fs::perms::owner_all);
    fs::create_symlink(fs::path(RAILFIX_BIN_DIR) / "railfix-tpr-publisher", bin / "railfix-tpr-publisher");
  }
  /// Until it waits for the fusion, the first of two.
  void begin_upgrade() {
    install_silent_release();
    write_manifest("9.9.8");
    begin({"upgrade", manifest()});
    ASSERT_TRUE(wait_until([&] { return status("fusion")["release"] == "9.9.8"; })) << test::slurp(said_);
  }
  void begin(std::vector<std::string> arguments) {
    arguments.insert(arguments.begin(), {"railfix", "train"});
    arguments.insert(arguments.end(), {"--root", root(), "--healthy-for", "1", "--patience", "100"});
    command_.emplace(arguments, test::Program::Options{said_, {}, {}});
  }
  test::Outcome rollback() { return train({"rollback", "--root", root(), "--healthy-for", "1", "--patience", "60"}); }
  const fs::path said_ = folder_ / "said";
  std::optional<test::Program> command_;
};

TEST_F(AtOnce, OneCommandAtATimeChangesWhatRuns) {
  ASSERT_EQ(up().exit_code, 0);
  begin_upgrade();
  const std::string holder =
      "railfix: railfix train upgrade \\(process [0-9]+, since [-0-9]+ [:0-9]+\\) is changing what runs here, and "
      "railfix "
      "train down works meanwhile; wait until it has ended, or end it with: kill [0-9]+\n";
  for (const auto& other : {up(), upgrade(), rollback()}) {
    EXPECT_EQ(other.exit_code, 2);
    EXPECT_THAT(other.err, MatchesRegex(holder));
    EXPECT_EQ(other.out, "");
  }
  EXPECT_FALSE(fs::exists(fs::path(root()) / "var/lib/railfix-train/generations/3")) << "the second one has begun";
  command_->end(SIGKILL);  // leaves nothing that would keep the next one off
  const auto back = rollback();
  EXPECT_EQ(back.exit_code, 0) << back.out << back.err;
  EXPECT_EQ(status("fusion")["release"], RAILFIX_TEST_RELEASE);
}

TEST_F(AtOnce, NothingBeginsWhileDownIsAtWork) {
  ASSERT_EQ(up().exit_code, 0);
  const auto supervisor =
      static_cast<pid_t>(std::stoll(test::slurp(folder_ / "root/var/lib/railfix-train/supervisor.lock")));
  ASSERT_GT(supervisor, 1);
  ASSERT_EQ(kill(supervisor, SIGSTOP), 0);  // so that `down` takes its time
  test::Program down({"railfix", "train", "down", "--root", root()}, {said_, {}, {}});
  ASSERT_TRUE(wait_until([&] {
    return test::slurp(folder_ / "root/var/lib/railfix-train/plan.yaml").find("down: true") != std::string::npos;
  }));
  for (const auto& other : {up(), train({"down", "--root", root()})}) {
    EXPECT_EQ(other.exit_code, 2);
    EXPECT_THAT(other.err,
                AllOf(HasSubstr("railfix train down (process "), HasSubstr(") is stopping what runs here; wait")));
  }
  ASSERT_EQ(kill(supervisor, SIGCONT), 0);
  EXPECT_EQ(down.wait_for_end(), 0);
  EXPECT_EQ(up().exit_code, 0);
}

// It does not wait for its patience to end, so that the train can be brought up again at once.
TEST_F(AtOnce, AnUpThatWaitsEndsWhenTheTrainIsTakenDown) {
  install_silent_release();
  write_manifest("9.9.8");
  begin({"up", manifest()});
  ASSERT_TRUE(wait_until([&] { return fs::exists(folder_ / "root/var/lib/railfix-train/state.yaml"); }));
  EXPECT_EQ(train({"down", "--root", root()}).exit_code, 0);
  const int64_t begun_ns = core::monotonic_ns();
  EXPECT_EQ(command_->wait_for_end(), 1);
  EXPECT_LT(core::seconds(core::monotonic_ns() - begun_ns), 10);
  EXPECT_THAT(test::slurp(said_), HasSubstr("another command has changed what runs here meanwhile"));
  EXPECT_THAT(test::slurp(folder_ / "root/var/lib/railfix-train/plan.yaml"), HasSubstr("down: true"));
}

TEST_F(AtOnce, AnUpgradeThatIsInterruptedSaysWhatRunsAndHowToGoOnOrBack) {
  ASSERT_EQ(up().exit_code, 0);
  begin_upgrade();
  EXPECT_EQ(command_->end(SIGINT), 130);
  EXPECT_THAT(test::slurp(said_), HasSubstr("railfix: interrupted, half done\n"
                                            "  already generation 2: fusion (release 9.9.8, not up yet)\n"
                                            "  still generation 1: tpr_publisher (release " RAILFIX_TEST_RELEASE ")\n"
                                            "  to go on:   railfix train upgrade " +
                                            manifest() + " --root " + root() +
                                            "\n  to go back: railfix train rollback --root " + root() + "\n"));
  const auto back = rollback();
  EXPECT_EQ(back.exit_code, 0) << back.out << back.err;
  EXPECT_THAT(back.out, HasSubstr("generation 1 runs again"));
  EXPECT_EQ(status("fusion")["release"], RAILFIX_TEST_RELEASE);
}

// What never ran whole is no way back, and a rollback that is half done goes on to where it was going.
TEST_F(AtOnce, WhatWasInterruptedIsTypedAgainAndGoesBackToWhatRanWhole) {
  ASSERT_EQ(up().exit_code, 0);
  begin_upgrade();
  EXPECT_EQ(command_->end(SIGINT), 130);
  write_manifest(RAILFIX_TEST_RELEASE, ", fusion: { use_gnss: false }, tpr_publisher: { nid_engine: 4711 }");
  const auto upgraded = upgrade();
  ASSERT_EQ(upgraded.exit_code, 0) << upgraded.out << upgraded.err;
  begin({"rollback"});
  ASSERT_TRUE(wait_until([&] { return test::slurp(said_).find("fusion: release ") != std::string::npos; }));
  EXPECT_EQ(command_->end(SIGINT), 130);
  EXPECT_THAT(test::slurp(said_), HasSubstr("  already generation 1: fusion (release "));
  EXPECT_THAT(test::slurp(said_), HasSubstr("  to go on:   railfix train rollback --root "));
  const auto back = rollback();
  EXPECT_THAT(back.out, HasSubstr("generation 1 runs again")) << back.err;
  EXPECT_THAT(rollback().err, HasSubstr("there is no generation before 1"));
}

}  // namespace
}  // namespace railfix
