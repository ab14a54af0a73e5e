// `railfix doctor` as a technician types it beside a train that runs.
#include <gmock/gmock.h>
#include <signal.h>
#include <sys/file.h>

#include <atomic>
#include <thread>

#include "integration/fleet/fleet_train.hpp"
#include "service/health_file.hpp"

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
  EXPECT_THAT(well.out, AllOf(Not(HasSubstr("error: fusion")), Not(HasSubstr(".pem")), Not(HasSubstr("supervisor")),
                              HasSubstr("its address, releases, map and keys only with --train TRAIN")));

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

// A service of this name speaks, and this test is its supervisor: a real one would have to be fed for it.
TEST_F(Doctor, SaysOfAServiceThatAnswersNothingWhatItSaysOfItself) {
  const auto home = folder_ / "root/var/lib/railfix-train";
  fs::create_directories(home);
  std::ofstream(home / "plan.yaml") << "train_id: " << id_
                                    << "\nhost: cab\ngeneration: 1\nprevious: 0\nservices: [{name: fusion, release: a, "
                                       "generation: 1, standby: false, command: [/no/such/program], settings: a}]\n";
  std::ofstream(home / "state.yaml") << "fusion: {pid: " << getpid() << ", generation: 1, restarts: 0, last_end: ''}\n";
  const int lock = open((home / "supervisor.lock").c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0644);
  ASSERT_EQ(flock(lock, LOCK_EX), 0);
  const auto pid = std::to_string(getpid());
  ASSERT_EQ(write(lock, pid.data(), pid.size()), static_cast<ssize_t>(pid.size()));
  service::CommonConfig common;
  common.train_id = id_;
  common.host = "cab";
  std::atomic<bool> ended = false;
  std::thread fusion([&] {
    service::HealthFile health(service::health_path(common, "fusion"));
    msg::ServiceStatus active;
    active.state(msg::STATE_ACTIVE);
    while (!ended) {
      const int64_t now_ns = core::monotonic_ns();
      health.write(active, {service::Flow::answers, false, now_ns - 10 * core::kNsPerSecond, now_ns, 0});
      poll(nullptr, 0, 100);
    }
  });
  EXPECT_TRUE(is_told("error: fusion input comes, nothing goes out: active"));
  const auto told = train({"status", "--root", root()});
  EXPECT_EQ(told.exit_code, 1) << told.out;
  EXPECT_FALSE(status("fusion")["healthy"].get<bool>());
  ended = true;
  fusion.join();
  close(lock);  // or `down` would end this test
}

}  // namespace
}  // namespace railfix
