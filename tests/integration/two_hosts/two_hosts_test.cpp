// A train on two computers: the sensors' side in the cab, reports and monitor in the coach. Real services, real DDS,
// two network namespaces with a cable.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/time.hpp"
#include "messaging/topics.hpp"
#include "service/health_file.hpp"
#include "support/program.hpp"
#include "support/run_until.hpp"
#include "support/two_hosts.hpp"

namespace railfix {
namespace {

namespace fs = std::filesystem;
namespace topics = messaging::topics;
using test::TwoHosts;

constexpr int kDomain = 91;
constexpr uint32_t kWidthPx = 1920;
constexpr uint32_t kHeightPx = 1200;
constexpr uint64_t kPictures = 60;

// This process is in the cab: Fast DDS takes all participants of a process for one computer's.
class TwoHostsTest : public ::testing::Test {
 protected:
  void SetUp() override {
    if (!hosts_.ready()) GTEST_SKIP() << "skipped: two network namespaces need root and the program ip (iproute2)";
    messaging::ParticipantOptions options;
    options.train_id = train_;
    options.domain = kDomain;
    options.interfaces = {TwoHosts::kInterface[TwoHosts::cab]};
    options.peers = {TwoHosts::kAddress[TwoHosts::coach]};
    cab_ = hosts_.on(TwoHosts::cab, [&] { return std::make_unique<messaging::Participant>(options); });
    fs::create_directories(folder_);
  }
  void TearDown() override { fs::remove_all(folder_); }

  std::unique_ptr<test::Program> start(TwoHosts::Host host, const std::string& program,
                                       std::vector<std::string> settings = {}) {
    for (const auto& setting : std::initializer_list<std::string>{
             "common.train_id=" + train_, "common.domain=" + std::to_string(kDomain), "common.log_level=error",
             std::string("common.host=") + (host == TwoHosts::cab ? "cab" : "coach"),
             std::string("common.interfaces=[") + TwoHosts::kInterface[host] + "]",
             std::string("common.peers=[") + TwoHosts::kAddress[1 - host] + "]"}) {
      settings.push_back(setting);
    }
    return hosts_.on(host, [&] { return std::make_unique<test::Program>(test::with_settings(program, settings)); });
  }
  // `railfix topics hz` in the coach; what it says goes into a file.
  std::unique_ptr<test::Program> count_in_coach(const std::string& topic, const fs::path& file) {
    return hosts_.on(TwoHosts::coach, [&] {
      return std::make_unique<test::Program>(std::vector<std::string>{"railfix", "topics", "hz", topic, "--train",
                                                                      train_, "--domain", std::to_string(kDomain)},
                                             test::Program::Options{file, {}, {}});
    });
  }
  template <class Condition>
  bool run_until(Condition condition) {
    return test::run_until(*cab_, queue_, condition);
  }

  const std::string train_ = "two-hosts-" + std::to_string(getpid());
  const fs::path folder_ = fs::temp_directory_path() / train_;
  TwoHosts hosts_;
  messaging::Queue queue_;
  std::unique_ptr<messaging::Participant> cab_;
};

// Motion as the camera would measure it, 30 times a second, with a picture of full size each time.
class Camera {
 public:
  explicit Camera(messaging::Participant& participant)
      : frames_(participant, topics::camera_frame, "cam0"), steps_(participant, topics::odometry_step) {}
  [[nodiscard]] bool heard() const { return frames_.matched_readers() > 0 && steps_.matched_readers() > 0; }
  void shoot() {
    ++seq_;
    frames_.write_in_place([&](msg::CameraFrame& frame) {
      frame.seq(seq_);
      frame.width_px(kWidthPx);
      frame.height_px(kHeightPx);
      std::fill_n(frame.data().begin(), kWidthPx * kHeightPx, static_cast<uint8_t>(seq_));
    });
    step();
  }
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

 private:
  messaging::Writer<msg::CameraFrame> frames_;
  messaging::Writer<msg::OdometryStep> steps_;
  uint64_t seq_ = 0;
  int64_t last_ns_ = 0;
};

TEST_F(TwoHostsTest, StatesAndReportsCrossTheCableAndPicturesDoNot) {
  auto fusion = start(TwoHosts::cab, "railfix-fusion");
  auto reports = start(TwoHosts::coach, "railfix-tpr-publisher");
  auto monitor = start(TwoHosts::coach, "railfix-monitor", {"monitor.port=0", "monitor.foxglove_port=-1"});
  const auto pictures_file = folder_ / "pictures";
  const auto states_file = folder_ / "states";
  auto pictures_in_coach = count_in_coach("camera_frame/cam0", pictures_file);
  auto states_in_coach = count_in_coach("train_state", states_file);
  Camera camera(*cab_);
  uint64_t pictures_in_cab = 0;
  uint64_t reports_in_cab = 0;
  std::set<std::string> services;
  messaging::Reader<msg::CameraFrame> near(*cab_, topics::camera_frame, "cam0", queue_,
                                           [&](const msg::CameraFrame&) { ++pictures_in_cab; });
  messaging::Reader<msg::TrainPositionReport> report(*cab_, topics::train_position_report, "", queue_,
                                                     [&](const msg::TrainPositionReport&) { ++reports_in_cab; });
  messaging::Reader<msg::ServiceStatus> status(
      *cab_, topics::service_status, "", queue_, [&](const msg::ServiceStatus& one) {
        services.insert(one.service().c_str() + std::string("@") + one.host().c_str());
      });
  ASSERT_TRUE(run_until([&] { return camera.heard() && services.size() == 3; }))
      << "heard of " << ::testing::PrintToString(services);
  EXPECT_THAT(services, ::testing::ElementsAre("fusion@cab", "monitor@coach", "tpr_publisher@coach"));
  const auto said = [](const fs::path& file, const char* what) {
    return test::slurp(file).find(what) != std::string::npos;
  };
  ASSERT_TRUE(run_until([&] { return said(pictures_file, "has no writer"); })) << test::slurp(pictures_file);

  const uint64_t bytes_before = hosts_.bytes_on_cable();
  for (uint64_t i = 1; i <= kPictures; ++i) {
    camera.shoot();
    ASSERT_TRUE(run_until([&] { return pictures_in_cab >= i; })) << "picture " << i << " did not reach its own host";
  }
  ASSERT_TRUE(run_until([&] {
    camera.step();
    return reports_in_cab > 0 && said(states_file, "train_state: ");
  })) << "no report has come back over the cable";
  const uint64_t bytes = hosts_.bytes_on_cable() - bytes_before;
  std::cout << "cable: " << bytes << " bytes, pictures in the cab: " << kPictures * kWidthPx * kHeightPx << " bytes\n";
  EXPECT_EQ(pictures_in_coach->end(SIGTERM), 1) << "pictures in the coach:\n" << test::slurp(pictures_file);
  EXPECT_GT(bytes, 1000U);
  EXPECT_LT(bytes, kPictures * kWidthPx * kHeightPx / 20);
}

/// What the cab hears of train_state: from whom, and the longest pause.
struct Heard {
  explicit Heard(messaging::Participant& participant, messaging::Queue& queue)
      : reader(participant, topics::train_state, "", queue,
               [this](const msg::TrainState&, const messaging::SampleInfo& info) {
                 if (!info.valid) return;
                 const int64_t now_ns = core::monotonic_ns();
                 if (last_ns != 0) longest_s = std::max(longest_s, core::seconds(now_ns - last_ns));
                 last_ns = now_ns;
                 writer = info.writer;
                 ++states;
               }) {}
  uint64_t states = 0;
  uint64_t writer = 0;
  double longest_s = 0;
  int64_t last_ns = 0;
  messaging::Reader<msg::TrainState> reader;
};

TEST_F(TwoHostsTest, AStandbyOnTheOtherHostTakesOver) {
  const std::vector<std::string> first{"common.ownership_strength=20"};
  const std::vector<std::string> second{"common.ownership_strength=10"};
  auto primary = start(TwoHosts::coach, "railfix-fusion", first);
  auto standby = start(TwoHosts::cab, "railfix-fusion", second);
  Camera camera(*cab_);
  Heard heard(*cab_, queue_);
  const auto drive = [&](auto condition) {
    int64_t next_ns = 0;
    return run_until([&] {
      if (core::monotonic_ns() >= next_ns) {
        camera.step();
        next_ns = core::monotonic_ns() + 33'000'000;
      }
      return condition();
    });
  };
  const auto drive_states = [&](uint64_t count) {
    const uint64_t until = heard.states + count;
    return drive([&] { return heard.states >= until; });
  };
  ASSERT_TRUE(drive([&] { return heard.reader.matched_writers() == 2; }));
  ASSERT_TRUE(drive_states(60));
  const uint64_t before = heard.writer;
  heard.longest_s = 0;
  primary->end(SIGKILL);
  ASSERT_TRUE(drive([&] { return heard.writer != before; })) << "nobody takes over";
  const double gap_s = heard.longest_s;
  std::cout << "gap in train_state when its fusion is killed: " << static_cast<int>(1000 * gap_s) << " ms\n";
  EXPECT_LT(gap_s, 2.0);  // the figure of a quiet machine is in docs/figures.md
}

TEST_F(TwoHostsTest, AServiceStartedWithoutTheCableEndsToBeStartedAgainWhenThereIsOne) {
  hosts_.plug(false);
  auto fusion = start(TwoHosts::cab, "railfix-fusion");
  service::CommonConfig common;
  common.train_id = train_;
  common.host = "cab";
  const auto health = service::health_path(common, "fusion");
  ASSERT_TRUE(run_until([&] { return service::ask_health(health).healthy; }));
  EXPECT_FALSE(fusion->exit_code());
  hosts_.plug(true);
  ASSERT_TRUE(run_until([&] { return fusion->exit_code().has_value(); })) << "does not mind the cable";
  EXPECT_EQ(fusion->exit_code(), 0);
}

}  // namespace
}  // namespace railfix
