// Services that are killed in the middle of a ride, with pictures and real pace, and started again at once, as a
// supervisor does: what the train says afterwards is true.
#include <gmock/gmock.h>

#include <map>
#include <set>

#include "evaluation/truth.hpp"
#include "mcap/reader.hpp"
#include "messaging/connected.hpp"
#include "messaging/topics.hpp"
#include "support/on_train.hpp"
#include "support/program.hpp"

namespace railfix {
namespace {

namespace fs = std::filesystem;
namespace topics = messaging::topics;

constexpr int kDomain = 86;
constexpr double kPatienceS = 240;
constexpr double kSureOfTrack = 0.999;
constexpr const char* kStart = "1:420";
// Less than a step is long (1.8 m), and what the IMU alone strays while no steps come.
constexpr double kStepTwiceM = 1.0;
constexpr double kStraysMps2 = 0.3;

class Restarts : public ::testing::Test, protected test::OnTrain {
 protected:
  Restarts()
      : OnTrain("restarts-" + std::to_string(getpid()), kDomain), control_(participant_, topics::service_control) {}
  void SetUp() override {
    fs::create_directories(folder_);
    // Balises every 400 m; twice as long as it takes on a quiet machine.
    const auto drawn = test::run_program(
        {"railfix",        "simulate", "--out",           ride(), "--start",   kStart,    "--duration-s", "65",
         "--speed-kmh",    "80",       "--accelerate",    "3",    "--size",    "640x512", "--rate-hz",    "12",
         "--format",       "jpg",      "--seed",          "31",   "--dwell-s", "1",       "--threads",    "2",
         "--only-ahead-m", "40",       "--only-beside-m", "4",    "--quiet"},
        kPatienceS);
    ASSERT_EQ(drawn.exit_code, 0) << drawn.err;
    truth_ = core::value_or_throw(evaluation::Truth::read(folder_ / "ride/truth"));
    listen(topics::train_state, [this](const msg::TrainState& state) { judge(state); });
    listen(topics::position_fix, [this](const msg::PositionFix& fix) {
      if (fix.kind() == msg::FIX_LANDMARK) ++landmark_fixes_;
    });
    listen(topics::odometry_step, [this](const msg::OdometryStep& step) {
      if (step.valid() == 0) return;
      ++valid_steps_;
      pause_s_ = std::max(pause_s_, core::seconds(step.stamp_ns() - last_step_ns_));
      last_step_ns_ = step.stamp_ns();
    });
    listen(topics::track_view, [this](const msg::TrackView& view) {
      if (view.seen_left() != 0 && view.seen_right() != 0) ++views_;
    });
    listen(topics::service_status,
           [this](const msg::ServiceStatus& status) { statuses_[status.service().c_str()] = status; });
    for (const char* service :
         {"recorder", "fusion", "map-matcher", "odometry", "track-detector", "sensor-gateway", "frame-grabber"})
      start(service);
  }
  void TearDown() override {
    programs_.clear();
    fs::remove_all(folder_);
    fs::remove("/dev/shm/railfix-notes-" + train_ + "-local-fusion");
  }

  [[nodiscard]] std::string ride() const { return (folder_ / "ride").string(); }
  void start(const std::string& service, const std::vector<std::string>& more = {}) {
    const std::string map = (folder_ / "ride/map/line.map").string();
    std::map<std::string, std::vector<std::string>> own{
        {"frame-grabber", {"frame_grabber.source=" + ride(), "frame_grabber.preview_hz=0"}},
        {"sensor-gateway", {"sensor_gateway.source=" + ride()}},
        {"map-matcher", {"map_matcher.map=" + map}},
        // No other sensor helps odometry but the IMU.
        {"fusion",
         {"fusion.map=" + map, std::string("fusion.start=") + kStart + ":+", "fusion.use_wheel=false",
          "fusion.use_gnss=false"}},
        {"recorder", {"recorder.folder=" + recordings().string(), "recorder.pictures=none"}}};
    auto settings = own[service];
    settings.insert(settings.end(), more.begin(), more.end());
    settings.insert(settings.end(), {"common.train_id=" + train_, "common.domain=" + std::to_string(kDomain),
                                     "common.log_level=error"});
    programs_[service] = std::make_unique<test::Program>(test::with_settings("railfix-" + service, settings));
  }
  void kill_and_start(const std::string& service, const std::vector<std::string>& more = {}) {
    programs_.at(service)->end(SIGKILL);
    start(service, more);
  }
  [[nodiscard]] fs::path recordings() const { return folder_ / "recordings"; }
  /// So many more than now, and of what comes from now on.
  bool comes(const uint64_t& counter, uint64_t more) {
    const uint64_t before = counter;
    return run_until([&] { return counter >= before + more; });
  }
  /// The ride goes on with a known place on the right track.
  bool knows_its_place() {
    return run_until([this] {
      return state_ && state_->track_known() != 0 && state_->track_probability() >= kSureOfTrack &&
             state_->integrity() == msg::INTEGRITY_OK;
    });
  }
  void judge(const msg::TrainState& state) {
    state_ = state;
    ++states_;
    const auto truth = truth_->at(state.stamp_ns());
    if (!truth || state.track_known() == 0 || state.integrity() == msg::INTEGRITY_UNUSABLE) return;
    const double east_m = state.easting_m() - truth->easting_m;
    const double north_m = state.northing_m() - truth->northing_m;
    error_m_ = east_m * std::sin(truth->heading_rad) + north_m * std::cos(truth->heading_rad);
    if (error_m_ > state.over_m() || -error_m_ > state.under_m()) ++outside_;
  }

  const fs::path folder_ = fs::temp_directory_path() / train_;
  std::optional<evaluation::Truth> truth_;
  messaging::Writer<msg::ControlRequest> control_;
  std::map<std::string, std::unique_ptr<test::Program>> programs_;
  std::map<std::string, msg::ServiceStatus> statuses_;
  std::optional<msg::TrainState> state_;
  double error_m_ = 0;
  uint64_t states_ = 0;
  uint64_t outside_ = 0;
  uint64_t landmark_fixes_ = 0;
  uint64_t valid_steps_ = 0;
  int64_t last_step_ns_ = 0;
  double pause_s_ = 0;  // longest between two steps
  uint64_t views_ = 0;
};

TEST_F(Restarts, WhatComesAfterAKillIsTrue) {
  ASSERT_TRUE(run_until(
      [this] { return statuses_.size() == 7 && messaging::all_connected(participant_.connections(), statuses_); }));
  msg::ControlRequest request;
  request.service("frame_grabber");
  request.command("start");
  control_.write(request);
  ASSERT_TRUE(comes(landmark_fixes_, 1));
  ASSERT_TRUE(knows_its_place());

  // The pictures begin at the front again: sensors and place go back with them.
  const int64_t before_ns = state_->stamp_ns();
  kill_and_start("frame-grabber", {"frame_grabber.start=immediately"});
  ASSERT_TRUE(run_until([&] { return state_->stamp_ns() < before_ns - core::kNsPerSecond; }));
  ASSERT_TRUE(comes(landmark_fixes_, 1));
  ASSERT_TRUE(knows_its_place());
  EXPECT_EQ(outside_, 0U) << "of " << states_;

  const double before_m = error_m_;
  pause_s_ = 0;
  kill_and_start("odometry");
  ASSERT_TRUE(comes(valid_steps_, 10));
  ASSERT_TRUE(knows_its_place());
  EXPECT_NEAR(error_m_, before_m, kStepTwiceM + kStraysMps2 * pause_s_ * pause_s_)
      << "a step was lost or counted twice";

  kill_and_start("track-detector");
  kill_and_start("map-matcher");
  ASSERT_TRUE(comes(views_, 10));
  ASSERT_TRUE(comes(landmark_fixes_, 1)) << "no reference point any more";
  ASSERT_TRUE(knows_its_place());

  // It must not believe that it stands where the ride began, and nobody else knows where it is.
  kill_and_start("fusion");
  ASSERT_TRUE(comes(states_, 5));
  ASSERT_TRUE(run_until([this] {
    return state_->track_known() != 0 && state_->integrity() != msg::INTEGRITY_UNUSABLE;
  })) << "it does not know its place";

  kill_and_start("recorder");
  ASSERT_TRUE(run_until([this] {
    const fs::directory_iterator files(recordings());
    return std::any_of(begin(files), end(files), [](const auto& one) { return one.path().extension() == ".mcap"; });
  })) << "what was recorded until the kill was not made a whole recording";
  ASSERT_TRUE(comes(states_, 20));
  EXPECT_EQ(programs_.at("recorder")->end(SIGTERM), 0);
  EXPECT_EQ(outside_, 0U) << "of " << states_;

  uint64_t recorded = 0;
  for (const auto& entry : fs::directory_iterator(recordings())) {
    const auto reader = core::value_or_throw(mcap::Reader::open(entry.path()));
    EXPECT_TRUE(reader->indexed()) << entry.path();
    reader->for_each({}, [&](const mcap::Channel& channel, const mcap::Message&) {
      if (channel.topic == "train_state") ++recorded;
      return true;
    });
    EXPECT_TRUE(reader->problems().empty()) << entry.path();
  }
  // A chunk of a second and the time until a new one listens are lost at the kill.
  EXPECT_GT(recorded, states_ * 3 / 4);
}

}  // namespace
}  // namespace railfix
