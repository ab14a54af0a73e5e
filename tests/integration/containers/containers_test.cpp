// Images as an operator gets them, and `railfix train` with containers on two hosts with a cable between them.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "core/time.hpp"
#include "messaging/topics.hpp"
#include "support/npm.hpp"
#include "support/program.hpp"
#include "support/run_until.hpp"
#include "support/two_hosts.hpp"

namespace railfix {
namespace {

namespace fs = std::filesystem;
namespace topics = messaging::topics;
using test::TwoHosts;
using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;

constexpr const char* kBase = "docker.io/library/debian:bookworm-slim";
constexpr const char* kEngineConf = "/etc/containers/railfix-containers.conf";
constexpr int kDomain = 23;
const fs::path kWork = CONTAINERS_WORK;
const fs::path kSource = RAILFIX_SOURCE_DIR;

test::Outcome shell(const std::string& commands) {
  return test::run_program({"/bin/bash", "-c", commands}, 600);
}

/// Images railfix/SERVICE:test of this build's fusion and tpr_publisher, built once.
class Images : public ::testing::Test {
 protected:
  static void SetUpTestSuite() {
    if (fs::exists(kEngineConf)) setenv("CONTAINERS_CONF", kEngineConf, 0);
    if (geteuid() != 0) {
      skipped_ = "containers of a train need root";
    } else if (shell(std::string("podman image inspect ") + kBase).exit_code != 0) {
      skipped_ =
          std::string("podman with the image ") + kBase + " is not here; ../shared/container-engine/setup makes both";
    } else if (const auto trial = shell(std::string("podman run --rm --init ") + kBase + " true");
               trial.exit_code != 0) {
      skipped_ = "podman cannot run containers here: " + trial.err;
    }
    if (!skipped_.empty()) return;
    fs::create_directories(kWork);
    const auto built = shell("cd '" + kSource.string() + "' && docker/collect '" RAILFIX_BUILD_DIR "' '" +
                             (kWork / "programs").string() + "' && docker/build --release test --programs '" +
                             (kWork / "programs").string() + "' fusion tpr-publisher");
    if (built.exit_code == 0) return;
    const std::string said = built.out + built.err;
    const bool no_network =
        said.find("Failed to fetch") != std::string::npos || said.find("Unable to fetch") != std::string::npos;
    (no_network ? skipped_ : failed_) =
        (no_network ? "Debian's packages cannot be fetched in a container here: " : "") + said;
  }
  void SetUp() override {
    if (!skipped_.empty()) GTEST_SKIP() << "skipped: " << skipped_;
    ASSERT_EQ(failed_, "");
  }
  inline static std::string skipped_;
  inline static std::string failed_;
};

TEST_F(Images, SayWhatTheyAreAndRunAsNobodyInParticular) {
  const auto said = shell("podman image inspect railfix/fusion:test");
  ASSERT_EQ(said.exit_code, 0) << said.err;
  const auto image = nlohmann::json::parse(said.out)[0];
  EXPECT_EQ(image["Config"]["User"], "990:990");
  const auto labels = image["Config"]["Labels"];
  EXPECT_EQ(labels["org.railfix.service"], "fusion");
  EXPECT_EQ(labels["org.opencontainers.image.version"], "test");
  EXPECT_EQ(labels["org.railfix.idl"].get<std::string>().size(), 64U);
  EXPECT_NE(labels["org.opencontainers.image.revision"], "");
  EXPECT_EQ(image["Healthcheck"]["Test"], nlohmann::json({"CMD", "/usr/bin/railfix-service", "--health"}));
  // Nobody runs there: the health check must say so, and not that all is well.
  const auto health = shell("podman run --rm --no-healthcheck --env RAILFIX_CONFIG= railfix/fusion:test --health");
  EXPECT_EQ(health.exit_code, 1) << health.err;
  EXPECT_THAT(health.out, HasSubstr("fusion: does not run here"));
}

TEST_F(Images, ShareTheLayersOfWhatTheyHaveInCommon) {
  const auto layers = [](const std::string& service) {
    const auto said = shell("podman image inspect railfix/" + service + ":test");
    return nlohmann::json::parse(said.out)[0]["RootFS"]["Layers"].get<std::vector<std::string>>();
  };
  const auto one = layers("fusion");
  const auto other = layers("tpr-publisher");
  const auto differ = std::mismatch(one.begin(), one.end(), other.begin(), other.end()).first;
  EXPECT_GE(differ - one.begin(), 4) << "base, user, packages of all, packages of those that know the map";
}

TEST_F(Images, CarryAValidBillOfMaterials) {
  if (!test::npm_is_there()) GTEST_SKIP() << "skipped: npm is not there";
  const auto sbom = kWork / "sbom.json";
  const auto text = shell(
      "podman run --rm --no-healthcheck --entrypoint cat railfix/tpr-publisher:test "
      "/usr/share/railfix/sbom.cdx.json >'" +
      sbom.string() + "'");
  ASSERT_EQ(text.exit_code, 0) << text.err;
  ASSERT_EQ(test::install_script(kSource / "tests/integration/containers", "validate.mjs", kWork), "");
  const auto in_work = "cd '" + kWork.string() + "' && ";
  const auto valid = shell(in_work + "node validate.mjs sbom.json");
  EXPECT_EQ(valid.exit_code, 0) << valid.out << valid.err;
  const auto broken =
      shell(in_work + "sed 's/\"library\"/\"libary\"/' sbom.json >broken.json && node validate.mjs broken.json");
  EXPECT_EQ(broken.exit_code, 1) << "the check above could not fail";

  const auto bill = nlohmann::json::parse(std::ifstream(sbom));
  std::map<std::string, nlohmann::json> parts;
  for (const auto& part : bill["components"]) parts[part["name"]] = part;
  for (const char* name : {"libfastrtps2.9", "libmosquitto1", "libsqlite3-0", "libc6"})
    EXPECT_TRUE(parts.contains(name)) << name;
  EXPECT_TRUE(parts.contains("libeigen3-dev") || parts.contains("libcli11-dev")) << "nothing that was compiled in";
  const auto sum = shell(
      "podman run --rm --no-healthcheck --entrypoint sha256sum railfix/tpr-publisher:test "
      "/usr/bin/railfix-tpr-publisher");
  EXPECT_THAT(sum.out, HasSubstr(parts["railfix-tpr-publisher"]["hashes"][0]["content"].get<std::string>()));
}

/// fusion in the cab, tpr_publisher in the coach; this process is in the cab.
class ContainerTrain : public Images {
 protected:
  void SetUp() override {
    Images::SetUp();
    if (IsSkipped() || HasFatalFailure()) return;
    if (!hosts_.ready()) GTEST_SKIP() << "skipped: two network namespaces need the program ip (iproute2)";
    fs::create_directories(folder_ / "train");
    write_manifest("test", "test");
    messaging::ParticipantOptions options;
    options.train_id = id_;
    options.domain = kDomain;
    options.interfaces = {TwoHosts::kInterface[TwoHosts::cab]};
    options.peers = {TwoHosts::kAddress[TwoHosts::coach]};
    cab_ = hosts_.on(TwoHosts::cab, [&] { return std::make_unique<messaging::Participant>(options); });
  }
  void TearDown() override {
    for (const auto host : {TwoHosts::cab, TwoHosts::coach}) train(host, {"down"});
    fs::remove_all(folder_);
  }
  void write_manifest(const std::string& fusion, const std::string& reports) const {
    std::ofstream(folder_ / "train" / "train.yaml")
        << "train:\n  id: " << id_ << "\n  domain: " << kDomain << "\n  release: test\n  hosts:\n"
        << "    cab: { address: " << TwoHosts::kAddress[TwoHosts::cab] << " }\n"
        << "    coach: { address: " << TwoHosts::kAddress[TwoHosts::coach] << " }\n"
        << "  services:\n    fusion: { host: cab, release: " << fusion << " }\n"
        << "    tpr_publisher: { host: coach, release: " << reports << " }\n"
        << "settings: { common: { log_level: warning } }\n";
  }
  // The host is found by its address, as on a train.
  test::Outcome train(TwoHosts::Host host, std::vector<std::string> arguments) {
    const auto verb = arguments[0];
    if (verb == "up" || verb == "upgrade") {
      arguments.insert(arguments.begin() + 1, (folder_ / "train").string());
      for (const char* more : {"--healthy-for", "1"}) arguments.push_back(more);
    }
    arguments.insert(arguments.begin(), {"railfix", "train"});
    arguments.insert(arguments.end(), {"--root", (folder_ / (host == TwoHosts::cab ? "cab" : "coach")).string()});
    return hosts_.on(host, [&] { return test::run_program(arguments, 300); });
  }
  nlohmann::json service(TwoHosts::Host host) {
    return nlohmann::json::parse(train(host, {"status", "--json"}).out)["services"][0];
  }
  std::string container(const std::string& host, const std::string& service) const {
    return "railfix-" + id_ + "-" + host + "-" + service;
  }
  const std::string id_ = "containers-" + std::to_string(getpid());
  const fs::path folder_ = fs::temp_directory_path() / id_;
  TwoHosts hosts_;
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
    return test::run_until(queue_, [&] {
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

TEST_F(ContainerTrain, ComesUpOnTwoHostsIsUpgradedComesBackAndGoesDown) {
  for (const auto host : {TwoHosts::cab, TwoHosts::coach}) {
    const auto up = train(host, {"up"});
    ASSERT_EQ(up.exit_code, 0) << up.out << up.err;
  }
  Ride ride(*cab_, queue_);
  ASSERT_TRUE(ride.reported()) << "no report has come back over the cable";
  const auto locked = shell(
      "podman inspect --format '{{.HostConfig.ReadonlyRootfs}} {{.Config.User}} caps:{{.EffectiveCaps}} "
      "{{.Path}}' " +
      container("coach", "tpr-publisher"));
  EXPECT_THAT(locked.out, HasSubstr("true 990:990 caps:[] /run/podman-init")) << locked.err;

  ASSERT_EQ(shell("podman kill " + container("cab", "fusion-1")).exit_code, 0);
  EXPECT_TRUE(test::run_until(queue_, [&] {
    const auto fusion = service(TwoHosts::cab);
    return fusion["restarts"] == 1 && fusion["healthy"] == true;
  })) << service(TwoHosts::cab);

  ASSERT_EQ(shell("podman tag railfix/tpr-publisher:test railfix/tpr-publisher:test-next").exit_code, 0);
  write_manifest("test", "test-next");
  const auto upgraded = train(TwoHosts::coach, {"upgrade"});
  EXPECT_EQ(upgraded.exit_code, 0) << upgraded.out << upgraded.err;
  EXPECT_EQ(service(TwoHosts::coach)["release"], "test-next");
  EXPECT_TRUE(ride.reported());

  const auto bad = shell(
      "printf 'FROM localhost/railfix/tpr-publisher:test\\nENTRYPOINT [\"/bin/sh\",\"-c\",\"test $0 = --version\"]\\n'"
      " | podman build -q --format docker -t railfix/tpr-publisher:test-bad -");
  ASSERT_EQ(bad.exit_code, 0) << bad.err;
  write_manifest("test", "test-bad");
  const auto refused = train(TwoHosts::coach, {"upgrade", "--patience", "8"});
  EXPECT_EQ(refused.exit_code, 1);
  EXPECT_THAT(refused.err, AllOf(HasSubstr("did not pass: tpr_publisher"), HasSubstr("runs again")));
  EXPECT_EQ(service(TwoHosts::coach)["release"], "test-next");
  EXPECT_TRUE(ride.reported());

  for (const auto host : {TwoHosts::cab, TwoHosts::coach}) EXPECT_EQ(train(host, {"down"}).exit_code, 0);
  EXPECT_THAT(shell("podman ps --all --format '{{.Names}}'").out, Not(HasSubstr(id_)));
}

TEST_F(ContainerTrain, AnImageThatIsMissingStartsNothing) {
  write_manifest("test-missing", "test");
  const auto up = train(TwoHosts::cab, {"up"});
  EXPECT_EQ(up.exit_code, 1);
  EXPECT_THAT(up.out, HasSubstr("image railfix/fusion:test-missing is not on this computer; "));
  EXPECT_EQ(train(TwoHosts::cab, {"status"}).exit_code, 2) << "something was started";
}

}  // namespace
}  // namespace railfix
