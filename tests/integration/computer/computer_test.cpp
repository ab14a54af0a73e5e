// A train's computer as its operator sets it up: our Debian packages, a manifest, `up`. systemd is real, in a
// container.
#include <gmock/gmock.h>

#include <nlohmann/json.hpp>
#include <thread>

#include "core/time.hpp"
#include "integration/containers/podman.hpp"

namespace railfix::test {
namespace {

namespace fs = std::filesystem;
using ::testing::AllOf;
using ::testing::HasSubstr;

constexpr double kPatienceS = 60;
constexpr const char* kBoot = "podman run --detach --systemd=always --network=none --shm-size=512m ";

class Computer : public ::testing::Test {
 protected:
  void SetUp() override {
    if (const auto why = why_no_podman(); !why.empty()) GTEST_SKIP() << "skipped: " << why;
    fs::remove_all(work_);
    fs::create_directories(work_ / "train");
    const auto packed = shell("cpack --config '" RAILFIX_BUILD_DIR "/CPackConfig.cmake' -B '" + work_.string() + "'");
    ASSERT_EQ(packed.exit_code, 0) << packed.out << packed.err;
    const auto image =
        shell("podman build -q --network=host -t " + name_ +
              " -f '" RAILFIX_SOURCE_DIR "/tests/integration/computer/Dockerfile' '" + work_.string() + "'");
    if (is_no_network(image)) GTEST_SKIP() << "skipped: Debian's packages cannot be fetched in a container here";
    ASSERT_EQ(image.exit_code, 0) << image.out << image.err;
    std::ofstream(work_ / "train/train.yaml")
        << "train:\n  id: vt612-004\n  domain: 94\n  release: " RAILFIX_VERSION
           "\n  run_as: programs\n  security: true\n"
        << "  hosts:\n    cab: { address: 127.0.0.1 }\n"
        << "  services: { fusion: cab, tpr_publisher: cab, recorder: cab, monitor: cab }\n"
        << "settings:\n  recorder: { folder: recordings }\n  tpr_publisher: { nid_engine: 612004 }\n";
    ASSERT_EQ(run_program({"railfix", "train", "keys", (work_ / "train").string()}, 60).exit_code, 0);
  }
  void TearDown() override {
    shell("podman rm --force --time 0 " + name_ + "; podman rmi --force " + name_);
    fs::remove_all(work_);
  }

  Outcome on_it(const std::string& command) { return shell("podman exec " + name_ + " " + command); }
  std::string answer(const std::string& command) {
    std::string text = on_it(command).out;
    while (!text.empty() && text.back() == '\n') text.pop_back();
    return text;
  }
  [[nodiscard]] pid_t supervisor() {
    return static_cast<pid_t>(std::atoi(answer("systemctl show railfix --property MainPID --value").c_str()));
  }
  /// By name; empty while not all of them are healthy.
  std::map<std::string, int64_t> healthy_services() {
    std::map<std::string, int64_t> pids;
    const auto status = on_it("railfix train status --json");
    if (status.exit_code != 0) return pids;
    const auto answer = nlohmann::json::parse(status.out);
    for (const auto& service : answer["services"]) pids[service["service"]] = service["pid"];
    return pids;
  }
  template <class Condition>
  bool comes(Condition condition) {
    for (const int64_t since_ns = core::monotonic_ns(); !condition();) {
      if (core::seconds(core::monotonic_ns() - since_ns) > kPatienceS) return false;
      std::this_thread::sleep_for(std::chrono::milliseconds(200));
    }
    return true;
  }
  std::string services_running() { return answer("sh -c 'cat /proc/[0-9]*/comm | grep ^railfix-'"); }
  std::string journal() { return on_it("journalctl --no-pager --unit railfix").out; }

  const std::string name_ = "railfix-computer-" + std::to_string(getpid());
  const fs::path work_ = fs::temp_directory_path() / name_;
};

TEST_F(Computer, IsSetUpWithPackagesAndComesBackByItself) {
  ASSERT_EQ(shell(kBoot + ("--name " + name_ + " " + name_)).exit_code, 0);
  ASSERT_TRUE(comes([&] { return answer("systemctl is-active railfix") == "active"; }))
      << "the package has not started its unit: " << journal();

  // The operator, on this computer.
  ASSERT_EQ(shell("podman cp '" + (work_ / "train").string() + "' " + name_ + ":/root/train").exit_code, 0);
  ASSERT_EQ(on_it("rm -r /root/train/security/authority").exit_code, 0);
  const auto up = on_it("railfix train up /root/train --healthy-for 1");
  ASSERT_EQ(up.exit_code, 0) << up.out << up.err << journal();
  std::map<std::string, int64_t> first;
  ASSERT_TRUE(comes([&] { return (first = healthy_services()).size() == 4; }))
      << on_it("railfix train status").out << journal();
  if (fs::exists(RAILFIX_BUILD_DIR "/share/monitor/page/index.html")) {  // npm was there
    const auto page = on_it(ask_for_page("127.0.0.1"));
    EXPECT_THAT(page.out, AllOf(HasSubstr("200 OK"), HasSubstr(kBuiltPage))) << page.err;
  }

  // A supervisor that dies: systemd starts the next one, the services do not notice.
  const pid_t before = supervisor();
  ASSERT_EQ(on_it("sh -c 'kill -9 " + std::to_string(before) + "'").exit_code, 0);
  ASSERT_TRUE(comes([&] { return supervisor() > 0 && supervisor() != before && !healthy_services().empty(); }));
  EXPECT_EQ(healthy_services(), first);

  // The package again, as for a newer tool: another supervisor, the same services.
  const pid_t second = supervisor();
  const auto again = on_it("sh -c 'dpkg --install /packages/railfix_*.deb'");
  ASSERT_EQ(again.exit_code, 0) << again.out << again.err;
  ASSERT_TRUE(comes([&] { return supervisor() > 0 && supervisor() != second && !healthy_services().empty(); }));
  EXPECT_EQ(healthy_services(), first);

  // The computer is switched off and on.
  ASSERT_EQ(shell("podman restart --time 60 " + name_).exit_code, 0);
  ASSERT_TRUE(comes([&] { return healthy_services().size() == 4; })) << journal();
  EXPECT_THAT(answer("systemctl is-system-running"), ::testing::AnyOf("running", "starting"));

  // Down is down, also for systemd, until it is brought up again.
  const auto down = on_it("railfix train down");
  ASSERT_EQ(down.exit_code, 0) << down.err;
  EXPECT_EQ(services_running(), "");
  ASSERT_EQ(on_it("systemctl restart railfix").exit_code, 0);
  ASSERT_TRUE(comes([&] { return supervisor() > 0; }));
  EXPECT_EQ(services_running(), "");
  const auto refused = on_it("railfix train upgrade /root/train");
  EXPECT_NE(refused.exit_code, 0);
  EXPECT_THAT(refused.err, HasSubstr("the train is down"));
  ASSERT_EQ(on_it("railfix train up /root/train --healthy-for 1").exit_code, 0) << journal();

  // Stopped in order: nothing stays behind.
  ASSERT_EQ(on_it("systemctl stop railfix").exit_code, 0) << journal();
  EXPECT_EQ(services_running(), "");
  EXPECT_EQ(answer("systemctl is-failed railfix"), "inactive") << journal();
  ASSERT_EQ(on_it("systemctl start railfix").exit_code, 0);
  ASSERT_TRUE(comes([&] { return healthy_services().size() == 4; })) << journal();

  const auto removed = on_it("apt-get remove -y -qq railfix");
  ASSERT_EQ(removed.exit_code, 0) << removed.out << removed.err;
  EXPECT_EQ(services_running(), "");
  EXPECT_EQ(on_it("systemctl --quiet is-enabled railfix").exit_code, 1);
  EXPECT_EQ(on_it("ls /var/lib/railfix-train/plan.yaml").exit_code, 0) << "the train's own files stay";
}

}  // namespace
}  // namespace railfix::test
