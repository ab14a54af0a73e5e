// What an operator is told who has made a mistake, and that nothing is changed by it.
#include <gmock/gmock.h>

#include "integration/fleet/fleet_train.hpp"
#include "support/loopback.hpp"

namespace railfix {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

class Operator : public FleetTest {
 protected:
  Operator() { write_manifest(RAILFIX_TEST_RELEASE); }
  [[nodiscard]] fs::path supervisor_lock() const { return folder_ / "root/var/lib/railfix-train/supervisor.lock"; }
};

TEST_F(Operator, AUserWithoutRightsIsToldHowItIsAndChangesNothing) {
  if (geteuid() != 0) GTEST_SKIP() << "needs root, to be somebody else";
  ASSERT_EQ(up().exit_code, 0);
  const std::string program = RAILFIX_BIN_DIR "/railfix";
  const auto as_nobody = [&](std::vector<std::string> arguments) {
    arguments.insert(arguments.begin(),
                     {"/usr/bin/setpriv", "--reuid=65534", "--regid=65534", "--clear-groups", program, "train"});
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

TEST_F(Operator, TheFolderOfAnotherTrainChangesNothing) {
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

TEST_F(Operator, AMistakeInTheManifestStartsNothing) {
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

TEST_F(Operator, ThePageIsSaidWhereItIsAndNotWhereItWasToBe) {
  const int other = test::tcp_socket();
  const auto port = std::to_string(test::bind_to_loopback(other));
  ASSERT_EQ(listen(other, 1), 0);
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

TEST_F(Operator, CheckSaysWhichComputersItHasNotAsked) {
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

// A manifest is also checked on an office computer: no error, but nothing is promised either.
TEST_F(Operator, CheckOnNoHostOfTheTrainPromisesNothingAndShowsBothSidesAddresses) {
  std::ofstream(folder_ / "train/train.yaml")
      << "train:\n  id: " << id_ << "\n  release: " RAILFIX_TEST_RELEASE "\n  run_as: programs\n  hosts: { "
      << "cab: { address: 10.99.1.11 }, coach: { address: 10.99.1.12 } }\n  services: { fusion: cab }\n";
  const auto addresses = "lo (127.0.0.1)";
  const auto wrong = "; the manifest has cab 10.99.1.11, coach 10.99.1.12: correct `address`, or say with --host";
  const auto checked = train({"check", manifest()});
  EXPECT_EQ(checked.exit_code, 0) << checked.out << checked.err;
  EXPECT_THAT(checked.out, HasSubstr("the manifest has no error; no computer was looked at"));
  EXPECT_THAT(checked.out, Not(HasSubstr("can start")));
  for (const auto& told : {checked.out, up().err}) {
    EXPECT_THAT(told, HasSubstr(addresses));
    EXPECT_THAT(told, HasSubstr(wrong));
  }
}

// What no check can know, such as a camera that another program has: the service ends with exit code 2, again and
// again.
TEST_F(Operator, AServiceThatRefusesItsConfigurationIsNotWaitedFor) {
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

TEST_F(Operator, WithoutSupervisorNothingIsUpgradedAndNoGenerationIsBlamed) {
  ASSERT_EQ(up().exit_code, 0);
  const auto supervisor = static_cast<pid_t>(std::stoll(test::slurp(supervisor_lock())));
  ASSERT_GT(supervisor, 1);
  ASSERT_EQ(kill(supervisor, SIGKILL), 0);
  ASSERT_TRUE(wait_until([&] { return !lives(supervisor); }));
  const auto refusal =
      "railfix: no supervisor runs here; railfix train up " + manifest() + " --root " + root() + " starts it\n";
  write_manifest(RAILFIX_TEST_RELEASE, ", fusion: { use_gnss: false }");
  for (const auto& refused : {upgrade("5"), train({"rollback", "--root", root(), "--patience", "5"})}) {
    EXPECT_EQ(refused.exit_code, 2);
    EXPECT_EQ(refused.err, refusal);
  }
  EXPECT_FALSE(fs::exists(folder_ / "root/var/lib/railfix-train/generations/2"));

  const auto orphans = status();
  for (const auto& service : orphans["services"]) {
    ASSERT_GT(service["pid"].get<pid_t>(), 1);
    kill(service["pid"].get<pid_t>(), SIGKILL);
  }
  const auto dead = " does not run here, neither its services nor their supervisor, and nobody has taken it down: ";
  EXPECT_TRUE(wait_until([&] {
    const auto doctor = test::run_program({"railfix", "doctor", "--root", root()}, 60);
    return doctor.exit_code == 1 && doctor.out.find("error: train " + id_ + dead + "railfix train up " + manifest() +
                                                    " --root " + root()) != std::string::npos;
  })) << test::run_program({"railfix", "doctor", "--root", root()}, 60).out;
}

// As on a full disk, which a test cannot fill for everybody.
TEST_F(Operator, DownEndsEverythingThoughItCannotBeNoted) {
  ASSERT_EQ(up().exit_code, 0);
  const auto before = status();
  const auto plan = folder_ / "root/var/lib/railfix-train/plan.yaml";
  fs::permissions(plan, fs::perms::owner_write | fs::perms::group_write | fs::perms::others_write,
                  fs::perm_options::remove);
  const auto down = train({"down", "--root", root()});
  fs::permissions(plan, fs::perms::owner_write, fs::perm_options::add);
  EXPECT_EQ(down.exit_code, 2);
  EXPECT_THAT(down.err, HasSubstr("the services are stopped, but cannot write " + plan.string()));
  EXPECT_THAT(down.err, HasSubstr("brings the train up again until that is mended and railfix train down --root " +
                                  root() + " is typed once more"));
  for (const auto& service : before["services"]) EXPECT_FALSE(lives(service["pid"].get<pid_t>())) << service;
}

}  // namespace
}  // namespace railfix
