// `fusion.start` is where the train stood when its computer was switched on, and nothing else: a fusion that is started
// in the middle of a live ride must not believe it.
#include <gmock/gmock.h>

#include "messaging/topics.hpp"
#include "support/on_train.hpp"
#include "support/program.hpp"
#include "track/map.hpp"

namespace railfix {
namespace {

namespace fs = std::filesystem;
namespace topics = messaging::topics;

constexpr int kDomain = 80;
constexpr double kStartM = 100;
constexpr double kPulsesPerM = 100;
constexpr double kAccelerationMps2 = 1;
constexpr int64_t kPeriodNs = 20'000'000;

class StartPlace : public ::testing::Test, public test::OnTrain {
 protected:
  StartPlace() : OnTrain("start-place-" + std::to_string(getpid()), kDomain) {}
  void SetUp() override {
    track::Map map;
    map.edges.push_back({1, "line", 1, 2, "", track::Alignment::chained({0, 0, 0}, {{9000, 0, 0}})});
    core::ok_or_throw(map.save(map_));
    start();
  }
  void TearDown() override {
    fusion_.reset();
    fs::remove(map_);
    forget_notes();
  }

  void start() {
    fusion_ = std::make_unique<test::Program>(test::with_settings(
        "railfix-fusion",
        {"fusion.map=" + map_.string(), "fusion.start=1:" + std::to_string(static_cast<int>(kStartM)) + ":+",
         "common.train_id=" + train_, "common.domain=" + std::to_string(kDomain), "common.log_level=error"}));
    ASSERT_TRUE(run_until([&] { return wheel_.matched_readers() > 0 && states_.matched_writers() > 0; }));
    state_.reset();
  }
  void forget_notes() const { fs::remove("/dev/shm/railfix-notes-" + train_ + "-local-fusion"); }
  void kill_and_start(bool has_notes = true) {
    fusion_->end(SIGKILL);
    if (!has_notes) forget_notes();
    ASSERT_TRUE(run_until([&] { return wheel_.matched_readers() == 0; }));
    start();
  }
  /// A wheel on its way to this speed, with the computer's own clock, which is `ahead_s` ahead of this one.
  void ride(double seconds, double speed_mps, double ahead_s = 0) {
    const int64_t until_ns = core::wall_ns() + core::to_ns(seconds);
    for (int64_t last_ns = core::wall_ns(), now_ns = last_ns; now_ns < until_ns; last_ns = now_ns) {
      const int64_t due_ns = core::monotonic_ns() + kPeriodNs;
      while (core::monotonic_ns() < due_ns) queue_.run_one(due_ns);
      // Also where this computer was held up a train goes as far as the time that its stamps say.
      now_ns = core::wall_ns();
      const double period_s = core::seconds(now_ns - last_ns);
      const double step_mps = kAccelerationMps2 * period_s;
      speed_mps_ += std::clamp(speed_mps - speed_mps_, -step_mps, step_mps);
      way_m_ += speed_mps_ * period_s;
      msg::WheelSample sample;
      sample.stamp_ns(now_ns + core::to_ns(ahead_s));
      sample.pulses(static_cast<int64_t>(way_m_ * kPulsesPerM));
      sample.pulses_per_metre(kPulsesPerM);
      wheel_.write(sample);
    }
  }
  [[nodiscard]] bool knows_its_place() const { return state_ && state_->track_known() != 0; }

  const fs::path map_ = fs::temp_directory_path() / (train_ + ".map");
  double way_m_ = 0;
  double speed_mps_ = 0;
  std::optional<msg::TrainState> state_;
  bool ever_known_ = false;
  messaging::Writer<msg::WheelSample> wheel_{participant_, topics::wheel_sample};
  messaging::Reader<msg::TrainState> states_{participant_, topics::train_state, "", queue_,
                                             [this](const msg::TrainState& state) {
                                               state_ = state;
                                               ever_known_ = ever_known_ || state.track_known() != 0;
                                             }};
  std::unique_ptr<test::Program> fusion_;
};

TEST_F(StartPlace, IsBelievedByATrainThatStands) {
  ride(3, 0);
  ASSERT_TRUE(knows_its_place());
  EXPECT_NEAR(state_->offset_m(), kStartM, 0.5);
  ride(6, 10);
  ASSERT_TRUE(knows_its_place());
  EXPECT_GT(state_->offset_m(), kStartM + 15);

  // Its notes are of this ride: it goes on from them.
  kill_and_start();
  ride(2, 10);
  ASSERT_TRUE(knows_its_place());
  EXPECT_GT(state_->offset_m(), kStartM + 25);

  // The clock was set: how old the notes are is not known any more, but the train has left its start.
  kill_and_start();
  ride(2, 10, 5);
  ASSERT_TRUE(state_);
  EXPECT_FALSE(knows_its_place()) << "at " << state_->offset_m();
}

// They say that less time has gone since its notes than has.
TEST_F(StartPlace, SamplesThatWaitedWhileItBeganDoNotCostATrainItsPlace) {
  ride(3, 0);
  ride(6, 10);
  kill_and_start();
  const int64_t until_ns = core::monotonic_ns() + core::kNsPerSecond;
  run_until([&] { return core::monotonic_ns() > until_ns; });
  speed_mps_ = 10;
  ride(0.3, 10, -1);
  ride(3, 10);
  ASSERT_TRUE(knows_its_place());
  EXPECT_GT(state_->offset_m(), kStartM + 25);

  // A clock that was set back says so for good.
  kill_and_start();
  ride(4, 10, -5);
  ASSERT_TRUE(state_);
  EXPECT_FALSE(knows_its_place()) << "at " << state_->offset_m();
}

// The sensors' computer may have another clock than this one: that makes no played data of them.
TEST_F(StartPlace, IsNotBelievedByATrainThatRuns) {
  for (const double ahead_s : {0.0, -60.0, 60.0}) {
    SCOPED_TRACE(ahead_s);
    speed_mps_ = 10;
    ride(3, 10, ahead_s);
    ASSERT_TRUE(state_);
    EXPECT_FALSE(ever_known_) << "not even before the speed is known";
    kill_and_start(false);
  }
}

TEST_F(StartPlace, TheIntervalGrowsWithoutSensorsWhateverTheirClockSaid) {
  ride(3, 0, -60);
  ASSERT_TRUE(knows_its_place());
  ride(3, 10, -60);
  const int64_t last_ns = state_->stamp_ns();
  EXPECT_TRUE(run_until([&] { return state_->stamp_ns() > last_ns + core::kNsPerSecond; }));
  EXPECT_TRUE(run_until([&] { return state_->integrity() == msg::INTEGRITY_UNUSABLE; }));
}

}  // namespace
}  // namespace railfix
