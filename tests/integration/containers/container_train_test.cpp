// `railfix train` with containers on two hosts with a cable between them, with Podman and with Docker.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "core/time.hpp"
#include "docker_engine.hpp"
#include "images.hpp"
#include "messaging/topics.hpp"
#include "support/run_until.hpp"
#include "support/two_hosts.hpp"

namespace railfix::test {
namespace {

namespace fs = std::filesystem;
namespace topics = messaging::topics;
using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;
using ::testing::StartsWith;

constexpr int kDomain = 23;

/// fusion and the monitor in the cab, tpr_publisher in the coach; this process is in the cab. The parameter is the
/// engine.
class ContainerTrain : public Images, public ::testing::WithParamInterface<const char*> {
 protected:
  void SetUp() override {
    Images::SetUp();
    if (IsSkipped() || HasFatalFailure()) return;
    if (!hosts_.ready()) GTEST_SKIP() << "skipped: two network namespaces need the program ip (iproute2)";
    fs::create_directories(folder_ / "train");
    if (docker()) start_engines();
    if (IsSkipped() || HasFatalFailure()) return;
    write_manifest("test", "test");
    cab_ = hosts_.on(TwoHosts::cab, [&] {
      return std::make_unique<messaging::Participant>(TwoHosts::network(TwoHosts::cab, id_, kDomain));
    });
  }
  void TearDown() override {
    for (const auto host : {TwoHosts::cab, TwoHosts::coach}) train(host, {"down"});
    for (auto& engine : engines_) engine.reset();
    fs::remove_all(folder_);
  }
  static bool docker() { return std::string(GetParam()) == "docker"; }
  void start_engines() {
    if (!DockerEngine::is_installed()) GTEST_SKIP() << "skipped: dockerd is not here (apt-get install docker.io)";
    const std::map<TwoHosts::Host, std::vector<std::string>> all{
        {TwoHosts::cab, {"railfix/fusion:test", "railfix/monitor:test"}},
        {TwoHosts::coach, {"railfix/tpr-publisher:test"}}};
    for (const auto& [host, images] : all) {
      auto& engine = engines_[host];
      engine =
          hosts_.on(host, [&, at = host] { return std::make_unique<DockerEngine>(folder_ / kNames[at] / "docker"); });
      if (!engine->answers())
        GTEST_SKIP() << "skipped: dockerd does not work here: " << slurp(folder_ / kNames[host] / "docker" / "log");
      for (const auto& image : images) {
        const auto taken = engine->take(image);
        ASSERT_EQ(taken.exit_code, 0) << taken.err;
      }
    }
  }
  void write_manifest(const std::string& fusion, const std::string& reports, const std::string& settings = "") const {
    std::ofstream(folder_ / "train" / "train.yaml")
        << "train:\n  id: " << id_ << "\n  domain: " << kDomain << "\n  release: test\n  run_as: " << GetParam()
        << "\n  hosts:\n"
        << "    cab: { address: " << TwoHosts::kAddress[TwoHosts::cab] << " }\n"
        << "    coach: { address: " << TwoHosts::kAddress[TwoHosts::coach] << " }\n"
        << "  services:\n    fusion: { host: cab, release: " << fusion << " }\n"
        << "    tpr_publisher: { host: coach, release: " << reports << " }\n    monitor: cab\n"
        << "settings:\n  common: { log_level: warning }\n"
        << settings;
  }
  // The host is found by its address, as on a train.
  Outcome train(TwoHosts::Host host, std::vector<std::string> arguments) {
    const auto verb = arguments[0];
    if (verb == "up" || verb == "upgrade") {
      arguments.insert(arguments.begin() + 1, (folder_ / "train").string());
      for (const char* more : {"--healthy-for", "1"}) arguments.push_back(more);
    }
    arguments.insert(arguments.begin(), {"railfix", "train"});
    arguments.insert(arguments.end(), {"--root", (folder_ / kNames[host]).string()});
    return here(host, [&] { return run_program(arguments, 300); });
  }
  /// What `work` starts lives on that host, and talks to its engine.
  template <class Work>
  auto here(TwoHosts::Host host, Work work) -> decltype(work()) {
    if (engines_[host]) setenv("DOCKER_HOST", engines_[host]->address().c_str(), 1);
    return hosts_.on(host, work);
  }
  Outcome engine(TwoHosts::Host host, const std::string& command) {
    return here(host, [&] { return shell(GetParam() + (" " + command)); });
  }
  nlohmann::json service(TwoHosts::Host host) {
    return nlohmann::json::parse(train(host, {"status", "--json"}).out)["services"][0];
  }
  std::string container(TwoHosts::Host host, const std::string& service) const {
    return "railfix-" + id_ + "-" + kNames[host] + "-" + service;
  }
  static constexpr const char* kNames[] = {"cab", "coach"};
  const std::string id_ = std::string("containers-") + GetParam() + "-" + std::to_string(getpid());
  const fs::path folder_ = fs::temp_directory_path() / id_;
  TwoHosts hosts_;
  std::array<std::unique_ptr<DockerEngine>, 2> engines_;
  messaging::Queue queue_;
  std::unique_ptr<messaging::Participant> cab_;
};

/// Moves at 10 m/s, and hears the reports.
class Ride {
 public:
  Ride(messaging::Participant& participant, messaging::Queue& queue)
      : participant_(participant),
        queue_(queue),
        steps_(participant, topics::odometry_step),
        reports_(participant, topics::train_position_report, "", queue,
                 [this](const msg::TrainPositionReport&) { ++heard_; }) {}
  /// False when no report comes that is newer than this call.
  bool reported() {
    const int before = heard_;
    return run_until(queue_, [&] {
      step();
      return heard_ > before;
    });
  }

 private:
  void step() {
    const int64_t now_ns = core::wall_ns();
    msg::OdometryStep step;
    step.stamp_ns(now_ns);
    step.reference_stamp_ns(last_ns_);
    step.step_m(last_ns_ == 0 ? 0 : 10 * core::seconds(now_ns - last_ns_));
    step.step_sigma_m(0.01);
    step.valid(last_ns_ == 0 ? 0 : 1);
    step.mode(msg::ODOMETRY_KEYFRAME);
    steps_.write(step);
    last_ns_ = now_ns;
  }
  messaging::Participant& participant_;
  messaging::Queue& queue_;
  messaging::Writer<msg::OdometryStep> steps_;
  int64_t last_ns_ = 0;
  int heard_ = 0;
  messaging::Reader<msg::TrainPositionReport> reports_;
};

TEST_P(ContainerTrain, ComesUpOnTwoHostsIsUpgradedComesBackAndGoesDown) {
  for (const auto host : {TwoHosts::cab, TwoHosts::coach}) {
    const auto up = train(host, {"up"});
    ASSERT_EQ(up.exit_code, 0) << up.out << up.err;
  }
  Ride ride(*cab_, queue_);
  ASSERT_TRUE(ride.reported()) << "no report has come back over the cable";
  const auto page = here(TwoHosts::cab, [] { return shell(ask_for_page(TwoHosts::kAddress[TwoHosts::cab])); });
  EXPECT_THAT(page.out, AllOf(HasSubstr("200 OK"), HasSubstr(kBuiltPage))) << page.err;
  const auto locked =
      engine(TwoHosts::coach, "inspect --format '{{.HostConfig.ReadonlyRootfs}} {{.Config.User}} {{.State.Pid}}' " +
                                  container(TwoHosts::coach, "tpr-publisher"));
  ASSERT_THAT(locked.out, StartsWith("true 990:990 ")) << locked.err;
  const auto process = fs::path("/proc") / std::to_string(std::stoi(locked.out.substr(locked.out.rfind(' '))));
  EXPECT_THAT(slurp(process / "status"), AllOf(HasSubstr("CapEff:\t0000000000000000\n"), HasSubstr("Uid:\t990\t990")));
  EXPECT_THAT(slurp(process / "comm"), HasSubstr("-init")) << "nobody would bury what a service leaves";

  ASSERT_EQ(engine(TwoHosts::cab, "kill " + container(TwoHosts::cab, "fusion-1")).exit_code, 0);
  EXPECT_TRUE(run_until(queue_, [&] {
    const auto fusion = service(TwoHosts::cab);
    return fusion["restarts"] == 1 && fusion["healthy"] == true;
  })) << service(TwoHosts::cab);

  const auto init = engine(TwoHosts::cab, "inspect --format '{{.State.Pid}}' " + container(TwoHosts::cab, "fusion-1"));
  ASSERT_EQ(shell("pid=" + init.out + "kill -STOP $(cat /proc/$pid/task/$pid/children)").exit_code, 0) << init.err;
  EXPECT_TRUE(run_until(queue_,
                        [&] {
                          const auto fusion = service(TwoHosts::cab);
                          return fusion["restarts"] == 2 && fusion["healthy"] == true;
                        }))
      << "one that hangs is not started anew: " << service(TwoHosts::cab);

  const std::string image = "railfix/tpr-publisher:test";
  ASSERT_EQ(engine(TwoHosts::coach, "tag " + image + " " + image + "-next").exit_code, 0);
  write_manifest("test", "test-next");
  const auto upgraded = train(TwoHosts::coach, {"upgrade"});
  EXPECT_EQ(upgraded.exit_code, 0) << upgraded.out << upgraded.err;
  EXPECT_EQ(service(TwoHosts::coach)["release"], "test-next");
  EXPECT_TRUE(ride.reported());

  // The engine's own builder, without its network: nothing is fetched.
  const auto bad = here(TwoHosts::coach, [&] {
    return shell("printf 'FROM " + image +
                 "\\nENTRYPOINT [\"/bin/sh\",\"-c\",\"test $0 = --version -o $0 = --check\"]\\n' | "
                 "BUILDAH_FORMAT=docker DOCKER_BUILDKIT=0 " +
                 GetParam() + " build -q -t " + image + "-bad -");
  });
  ASSERT_EQ(bad.exit_code, 0) << bad.err;
  write_manifest("test", "test-bad");
  const auto refused = train(TwoHosts::coach, {"upgrade", "--patience", "8"});
  EXPECT_EQ(refused.exit_code, 1);
  EXPECT_THAT(refused.err, AllOf(HasSubstr("did not pass: tpr_publisher"), HasSubstr("runs again")));
  EXPECT_EQ(service(TwoHosts::coach)["release"], "test-next");
  EXPECT_TRUE(ride.reported());

  for (const auto host : {TwoHosts::cab, TwoHosts::coach}) EXPECT_EQ(train(host, {"down"}).exit_code, 0);
  for (const auto host : {TwoHosts::cab, TwoHosts::coach})
    EXPECT_THAT(engine(host, "ps --all --format '{{.Names}}'").out, Not(HasSubstr(id_)));
}

TEST_P(ContainerTrain, AnImageThatIsMissingStartsNothing) {
  write_manifest("test-missing", "test");
  const auto up = train(TwoHosts::cab, {"up"});
  EXPECT_EQ(up.exit_code, 1);
  EXPECT_THAT(up.out, HasSubstr("not on this computer: image railfix/fusion:test-missing; "));
  EXPECT_EQ(train(TwoHosts::cab, {"status"}).exit_code, 2) << "something was started";
}

TEST_P(ContainerTrain, AWrongKeyIsToldByTheImageAndStartsNothing) {
  write_manifest("test", "test", "  fusion: { no_such_key: 1 }\n");
  const auto up = train(TwoHosts::cab, {"up"});
  EXPECT_EQ(up.exit_code, 1);
  EXPECT_THAT(up.out, HasSubstr("error: fusion: " + (folder_ / "train/train.yaml").string() +
                                " line 15: fusion.no_such_key is not a key of this section"));
  EXPECT_THAT(up.out, Not(HasSubstr("settings of fusion are not checked")));
  EXPECT_EQ(train(TwoHosts::cab, {"status"}).exit_code, 2) << "something was started";
  EXPECT_THAT(engine(TwoHosts::cab, "ps --all --format '{{.Names}}'").out, Not(HasSubstr(id_)));
}

TEST_P(ContainerTrain, ItsComposeFileRuns) {
  if (!docker()) GTEST_SKIP() << "skipped: podman-compose of Debian 12 refuses the host's network";
  if (shell("command -v docker-compose").exit_code != 0) GTEST_SKIP() << "skipped: docker-compose is not here";
  const auto out = folder_ / "rendered";
  const auto train_folder = (folder_ / "train").string();
  ASSERT_EQ(run_program({"railfix", "train", "render", train_folder, "--out", out.string()}, 60).exit_code, 0);
  const auto file = (out / "cab" / "compose.yaml").string();
  // What the services keep goes below the test's folder, and not into that of this computer.
  const auto home = (folder_ / "home").string();
  ASSERT_EQ(shell("install -d -o 990 -g 990 " + home + " && sed -i 's|- /var/lib/railfix:|- " + home + ":|' " + file)
                .exit_code,
            0);
  const auto compose = [&](const std::string& what) {
    return here(TwoHosts::cab, [&] { return shell("docker-compose -f " + file + " " + what); });
  };
  const auto up = compose("up -d");
  ASSERT_EQ(up.exit_code, 0) << up.err;
  const auto health = "inspect --format '{{.State.Health.Status}}' " + container(TwoHosts::cab, "fusion");
  EXPECT_TRUE(run_until(queue_, [&] { return engine(TwoHosts::cab, health).out == "healthy\n"; }))
      << engine(TwoHosts::cab, "logs " + container(TwoHosts::cab, "fusion")).err;
  EXPECT_EQ(compose("down").exit_code, 0);
}

INSTANTIATE_TEST_SUITE_P(Engines, ContainerTrain, ::testing::Values("podman", "docker"),
                         [](const auto& engine) { return std::string(engine.param); });

}  // namespace
}  // namespace railfix::test
