// Another odometry takes over from one that has counted for kilometres: what map_matcher says of the track stays true.
#include <gmock/gmock.h>

#include "messaging/topics.hpp"
#include "support/on_train.hpp"
#include "support/program.hpp"
#include "track/map.hpp"

namespace railfix {
namespace {

namespace fs = std::filesystem;
namespace topics = messaging::topics;

constexpr int kDomain = 82;
constexpr double kSpeedMps = 10;
constexpr double kPeriodS = 0.1;
constexpr double kEdgeM = 3000;
constexpr double kBeginM = kEdgeM + 100;  // of the data, on the way of both edges
constexpr double kCountedM = 2900;        // by the first odometry until then

class OdometryAnew : public ::testing::Test, public test::OnTrain {
 protected:
  OdometryAnew() : OnTrain("odometry-anew-" + std::to_string(getpid()), kDomain) {}
  void SetUp() override {
    track::Map map;
    map.edges.push_back({1, "behind", 1, 2, "", track::Alignment::chained({0, 0, 0}, {{kEdgeM, 0, 0}})});
    map.edges.push_back({2, "here", 2, 3, "", track::Alignment::chained({0, kEdgeM, 0}, {{kEdgeM, 0, 0}})});
    map.connections = {{2, 1, 2, false}};
    core::ok_or_throw(map.save(map_));
    matcher_ = std::make_unique<test::Program>(test::with_settings(
        "railfix-map-matcher", {"map_matcher.map=" + map_.string(), "common.train_id=" + train_,
                                "common.domain=" + std::to_string(kDomain), "common.log_level=error"}));
    ASSERT_TRUE(run_until(
        [&] { return states_.matched_readers() > 0 && steps_.matched_readers() > 0 && fixes_.matched_writers() > 0; }));
  }
  void TearDown() override { fs::remove(map_); }

  [[nodiscard]] double place_m() const { return kBeginM + kSpeedMps * kPeriodS * static_cast<double>(tick_); }
  [[nodiscard]] int64_t stamp_ns(int64_t tick) const {
    return core::to_ns(1000 + kPeriodS * static_cast<double>(tick));
  }

  /// The next state of the train and, `counted_m` not being NaN, the next step of an odometry that has counted so far.
  void tick(double counted_m) {
    ++tick_;
    msg::TrainState state;
    state.stamp_ns(stamp_ns(tick_));
    state.edge(2);
    state.offset_m(place_m() - kEdgeM);
    state.distance_m(kCountedM + place_m() - kBeginM);
    state.speed_mps(kSpeedMps);
    state.over_m(2);
    state.under_m(2);
    state.sigma_m(0.3);
    state.visual_scale(1);
    state.track_known(1);
    state.track_probability(1);
    state.direction(msg::DIRECTION_FORWARD);
    states_.write(state);
    if (!std::isnan(counted_m)) {
      msg::OdometryStep step;
      step.stamp_ns(stamp_ns(tick_));
      step.reference_stamp_ns(stamp_ns(tick_ - 1));
      step.step_m(kSpeedMps * kPeriodS);
      step.step_sigma_m(0.01);
      step.yaw_sigma_rad(1e-4);
      step.distance_m(counted_m);
      step.speed_mps(kSpeedMps);
      step.mode(msg::ODOMETRY_TRACK);
      step.valid(1);
      steps_.write(step);
    }
    queue_.run_one(core::monotonic_ns() + 5'000'000);
  }
  void ride(double seconds, double counted_m) {
    for (double t_s = 0; t_s < seconds; t_s += kPeriodS) tick(counted_m += kSpeedMps * kPeriodS);
  }

  const fs::path map_ = fs::temp_directory_path() / (train_ + ".map");
  int64_t tick_ = 0;
  std::vector<msg::PositionFix> said_;
  messaging::Writer<msg::TrainState> states_{participant_, topics::train_state};
  messaging::Writer<msg::OdometryStep> steps_{participant_, topics::odometry_step};
  messaging::Reader<msg::PositionFix> fixes_{participant_, topics::position_fix, "", queue_,
                                             [this](const msg::PositionFix& fix) { said_.push_back(fix); }};
  std::unique_ptr<test::Program> matcher_;
};

TEST_F(OdometryAnew, TheTrackIsSaidWhereTheTrainIs) {
  ride(5, kCountedM);
  ride(5, 0);     // warm already, beside the one before
  ride(10, NAN);  // nobody
  ride(5, 0);
  ASSERT_TRUE(run_until([&] { return !said_.empty() && said_.back().stamp_ns() > stamp_ns(tick_ - 12); }));
  EXPECT_GT(said_.size(), 15U) << "one a second";
  for (const auto& fix : said_) {
    const double train_m = kBeginM + kSpeedMps * core::seconds(fix.stamp_ns() - stamp_ns(0));
    EXPECT_EQ(fix.kind(), msg::FIX_TRACK);
    EXPECT_EQ(fix.edge(), 2U) << "at " << train_m;
    EXPECT_NEAR(kEdgeM + fix.offset_m(), train_m, 3) << "edge " << fix.edge();
  }
}

}  // namespace
}  // namespace railfix
