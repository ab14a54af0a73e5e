// `railfix doctor` as a technician types it beside a train that runs.
#include <gmock/gmock.h>
#include <signal.h>

#include "integration/fleet/fleet_train.hpp"

namespace railfix {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;

class Doctor : public FleetTest {
 protected:
  Doctor() {
    std::ofstream(folder_ / "train" / "train.yaml")
        << "train:\n  id: " << id_ << "\n  domain: 95\n  release: " RAILFIX_TEST_RELEASE
        << "\n  run_as: programs\n  security: true\n  hosts: { cab: { address: 127.0.0.1 } }\n"
           "  services: { fusion: cab, tpr_publisher: cab }\nsettings: { common: { log_level: warning } }\n";
  }
  test::Outcome doctor() { return test::run_program({"railfix", "doctor", "--root", root()}, 60); }
  bool is_told(const std::string& text) {
    return wait_until([&] { return doctor().out.find(text) != std::string::npos; });
  }
};

TEST_F(Doctor, SaysWhatIsWrongWithTheTrainThatRunsHere) {
  ASSERT_EQ(train({"keys", manifest()}).exit_code, 0);
  const auto started = up();
  ASSERT_EQ(started.exit_code, 0) << started.out << started.err;
  const auto well = doctor();
  const auto top = test::run_program({"railfix", "top", "--once", "--train", id_, "--root", root()}, 60);
  EXPECT_EQ(top.exit_code, 0) << "this computer knows its own train's domain and certificates: " << top.err;
  EXPECT_THAT(top.out, HasSubstr("fusion"));
  EXPECT_THAT(well.out, AllOf(Not(HasSubstr("error: fusion")), Not(HasSubstr(".pem")), Not(HasSubstr("supervisor"))));

  // A key that somebody has exchanged on this host.
  const auto security = folder_ / "root/var/lib/railfix-train/generations/1/security";
  const auto key = test::slurp(security / "fusion.key.pem");
  fs::copy_file(security / "tpr_publisher.key.pem", security / "fusion.key.pem", fs::copy_options::overwrite_existing);
  const auto other_key = doctor();
  EXPECT_EQ(other_key.exit_code, 1);
  EXPECT_THAT(other_key.out, AllOf(HasSubstr("error: "), HasSubstr("fusion.key.pem is not the private key of "),
                                   HasSubstr("this computer must not run Railfix like this")));
  std::ofstream(security / "fusion.key.pem") << key;
  EXPECT_THAT(doctor().out, Not(HasSubstr(".pem")));

  // A service that does not work, and nobody who starts it again.
  const auto lock = folder_ / "root/var/lib/railfix-train/supervisor.lock";
  const auto supervisor = static_cast<pid_t>(std::stoll(test::slurp(lock)));
  ASSERT_GT(supervisor, 1);
  const auto fusion = status("fusion")["pid"].get<pid_t>();
  ASSERT_GT(fusion, 1);
  ASSERT_EQ(kill(supervisor, SIGSTOP), 0);
  ASSERT_EQ(kill(fusion, SIGSTOP), 0);
  EXPECT_TRUE(is_told("error: fusion dead or frozen")) << doctor().out;
  EXPECT_EQ(doctor().exit_code, 1);
  ASSERT_EQ(kill(fusion, SIGCONT), 0);
  ASSERT_EQ(kill(supervisor, SIGKILL), 0);
  EXPECT_TRUE(is_told("error: services run without a supervisor: railfix train up " + manifest() + " --root " + root() +
                      " starts it"))
      << doctor().out;
}

}  // namespace
}  // namespace railfix
