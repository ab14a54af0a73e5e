// Every service of a running train is replaced by another build of it (tests/support/other_build), and that one again,
// while pictures come in and reports go out.
#include <gmock/gmock.h>

#include <algorithm>
#include <atomic>
#include <map>
#include <mutex>
#include <thread>

#include "integration/fleet/fleet_train.hpp"
#include "messaging/topics.hpp"
#include "support/network.hpp"

namespace railfix {
namespace {

using ::testing::HasSubstr;

constexpr int kDomain = 96;
constexpr const char* kUsual = RAILFIX_TEST_RELEASE;
constexpr const char* kOther = RAILFIX_TEST_RELEASE "-other";
constexpr const char* kOtherTopics = RAILFIX_TEST_RELEASE "-topics";
constexpr size_t kServices = 9;
constexpr double kRideS = 360;
// A report a second. On a train at most one of them does not come; on a machine that builds meanwhile a few.
constexpr double kLongestPauseS = 5;

/// Who listens on the train all the time, as the ground would.
class Listener {
 public:
  explicit Listener(const std::string& train) : participant_(options(train)) {}
  ~Listener() {
    ended_ = true;
    thread_.join();
  }
  /// What each service that runs now says of itself.
  std::map<std::string, std::string> versions() {
    const std::lock_guard lock(mutex_);
    return versions_;
  }
  size_t reports() {
    const std::lock_guard lock(mutex_);
    return reports_;
  }
  double longest_pause_s() {
    const std::lock_guard lock(mutex_);
    return std::max(longest_pause_s_, core::seconds(core::monotonic_ns() - last_ns_));
  }

 private:
  static messaging::ParticipantOptions options(const std::string& train) {
    auto options = test::network(train, kDomain);
    options.interfaces = {"127.0.0.1"};
    return options;
  }
  void hear_report() {
    const std::lock_guard lock(mutex_);
    const int64_t now_ns = core::monotonic_ns();
    if (reports_++ > 0) longest_pause_s_ = std::max(longest_pause_s_, core::seconds(now_ns - last_ns_));
    last_ns_ = now_ns;
  }
  void hear_status(const msg::ServiceStatus& status) {
    const std::lock_guard lock(mutex_);
    if (status.state() != msg::STATE_STOPPED) versions_[status.service().c_str()] = status.version().c_str();
  }
  std::mutex mutex_;
  std::map<std::string, std::string> versions_;
  size_t reports_ = 0;
  int64_t last_ns_ = core::monotonic_ns();
  double longest_pause_s_ = 0;
  messaging::Participant participant_;
  messaging::Queue queue_;
  messaging::Reader<msg::TrainPositionReport> report_{participant_, messaging::topics::train_position_report, "",
                                                      queue_,
                                                      [this](const msg::TrainPositionReport&) { hear_report(); }};
  messaging::Reader<msg::ServiceStatus> status_{participant_, messaging::topics::service_status, "", queue_,
                                                [this](const msg::ServiceStatus& status) { hear_status(status); }};
  std::atomic<bool> ended_ = false;
  std::thread thread_{[this] {
    while (!ended_) queue_.run_one(core::monotonic_ns() + core::kNsPerSecond / 10);
  }};
};

class OtherBuild : public FleetTest {
 protected:
  OtherBuild() {
    install_release(kOther, "other_build");
    install_release(kOtherTopics, "other_topics");
  }
  void draw_ride() {
    const auto drawn = test::run_program(
        {"railfix", "simulate", "--line", "long", "--start", "1:100", "--duration-s", std::to_string(kRideS), "--size",
         "320x256", "--rate-hz", "3", "--speed-kmh", "40", "--format", "jpg", "--quiet", "--out", ride().string()},
        600);
    ASSERT_EQ(drawn.exit_code, 0) << drawn.err;
    fs::copy_file(ride() / "map/line.map", folder_ / "train/line.map");
    began_ns_ = core::wall_ns() + 10 * core::kNsPerSecond;
  }
  [[nodiscard]] fs::path ride() const { return folder_ / "ride"; }
  void install_release(const std::string& release, const std::string& built) {
    const auto at = fs::path(root()) / "opt/railfix" / release;
    fs::create_directories(at);
    fs::create_symlink(fs::path(RAILFIX_BUILD_DIR) / built / "bin", at / "bin");
  }
  /// Of a train with all services, for which it is drawn what they see.
  void write_manifest(const std::string& release) {
    std::ofstream(folder_ / "train/train.yaml")
        << "train:\n  id: " << id_ << "\n  domain: " << kDomain << "\n  release: " << release
        << "\n  run_as: programs\n  map: line.map\n  hosts: { cab: { address: 127.0.0.1 } }\n"
        << "  services:\n    frame_grabber: cab\n    sensor_gateway: cab\n    track_detector: cab\n    odometry: cab\n"
        << "    map_matcher: cab\n    fusion: cab\n"
        << "    tpr_publisher: cab\n    recorder: cab\n    monitor: cab\n"
        << "settings:\n  common: { log_level: warning }\n  frame_grabber: { source: " << ride().string()
        << ", start: immediately, preview_hz: 1, began_s: " << std::to_string(core::seconds(began_ns_)) << " }\n"
        << "  sensor_gateway: { source: " << ride().string() << " }\n  fusion: { start: \"1:100\" }\n"
        << "  tpr_publisher: { nid_engine: 460042, t_cycloc_s: 1 }\n"
        << "  recorder: { folder: recordings, keep_free_mb: 20, quota_mb: 150, pictures: none }\n"
        << "  monitor: { port: 0, foxglove_port: -1 }\n";
  }
  /// The plan of the supervisor, and what the programs say themselves.
  void expect_all_run(const std::string& release, Listener& listener) {
    const auto all = status();
    ASSERT_EQ(all["services"].size(), kServices);
    for (const auto& one : all["services"]) {
      EXPECT_EQ(one["release"], release) << one;
      EXPECT_TRUE(one["healthy"]) << one;
    }
    EXPECT_TRUE(wait_until([&] {
      const auto versions = listener.versions();
      return versions.size() == kServices &&
             std::ranges::all_of(versions, [&](const auto& one) { return one.second == release; });
    })) << ::testing::PrintToString(listener.versions());
  }
  int64_t began_ns_ = 0;  // when the first picture is taken
};

TEST_F(OtherBuild, TakesThePlaceOfEveryServiceAndGivesItBackWhileReportsGoOn) {
  draw_ride();
  if (HasFatalFailure()) return;
  write_manifest(kUsual);
  Listener listener(id_);
  const auto started = up();
  ASSERT_EQ(started.exit_code, 0) << started.out << started.err;
  ASSERT_TRUE(wait_until([&] { return listener.reports() > 3; })) << "no data flows";
  expect_all_run(kUsual, listener);

  write_manifest(kOther);
  const auto difference = train({"diff", manifest(), "--root", root()});
  EXPECT_THAT(difference.out, HasSubstr(std::string("fusion: release ") + kUsual + " -> " + kOther));
  const auto before = listener.reports();
  const auto upgraded = upgrade();
  ASSERT_EQ(upgraded.exit_code, 0) << upgraded.out << upgraded.err;
  expect_all_run(kOther, listener);
  EXPECT_GT(listener.reports(), before + 10);

  const auto back = train({"rollback", "--root", root(), "--healthy-for", "1", "--patience", "60"});
  ASSERT_EQ(back.exit_code, 0) << back.out << back.err;
  expect_all_run(kUsual, listener);
  EXPECT_LT(listener.longest_pause_s(), kLongestPauseS) << listener.reports() << " reports";
  std::cout << listener.reports() << " reports, longest pause " << listener.longest_pause_s() << " s\n";
}

TEST_F(OtherBuild, MadeOfOtherTopicsIsRefusedAndNothingIsTouched) {
  const auto manifest_of = [&](const std::string& services) {
    std::ofstream(folder_ / "train/train.yaml")
        << "train:\n  id: " << id_ << "\n  domain: " << kDomain << "\n  release: " << kUsual
        << "\n  run_as: programs\n  hosts: { cab: { address: 127.0.0.1 } }\n  services: " << services << "\n";
  };
  const std::string misfit = std::string("release ") + kOtherTopics +
                             " of fusion was made of other topics (position.idl) than release " + kUsual;
  manifest_of("{ fusion: cab }");
  ASSERT_EQ(up().exit_code, 0);
  const auto before = status("fusion");
  manifest_of(std::string("{ fusion: { host: cab, release: ") + kOtherTopics + " } }");
  const auto refused = upgrade();
  EXPECT_EQ(refused.exit_code, 1);
  EXPECT_THAT(refused.err, HasSubstr(misfit + " of fusion, which runs here: they would not hear each other"));
  EXPECT_EQ(status("fusion"), before);

  manifest_of(std::string("{ tpr_publisher: cab, fusion: { host: cab, release: ") + kOtherTopics + " } }");
  const auto mixed = upgrade();
  EXPECT_EQ(mixed.exit_code, 1);
  EXPECT_THAT(mixed.out,
              HasSubstr(misfit + " of tpr_publisher: they would not hear each other; take releases that fit"));
  EXPECT_EQ(status("fusion"), before);
}

}  // namespace
}  // namespace railfix
