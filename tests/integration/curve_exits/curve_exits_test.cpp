// The baseline of paper 004 in service: map_matcher with `curve_method: exits` tells where the train is behind a curve,
// though the body turns anywhere up to lag_m behind the camera's foot, and says how sure that is.
#include <gmock/gmock.h>

#include "messaging/topics.hpp"
#include "support/on_train.hpp"
#include "support/program.hpp"
#include "track/map.hpp"

namespace railfix {
namespace {

namespace fs = std::filesystem;
namespace topics = messaging::topics;

constexpr int kDomain = 94;
constexpr double kSpeedMps = 20;
constexpr double kPeriodS = 0.1;
constexpr double kBeginM = 50;
constexpr double kPromisedM = 25;

class CurveExits : public ::testing::TestWithParam<double>, public test::OnTrain {
 protected:
  CurveExits() : OnTrain("curve-exits-" + std::to_string(getpid()), kDomain) {}
  void SetUp() override {
    track::Map map;
    map.edges.push_back({1, "line", 1, 2, "", line_});
    core::ok_or_throw(map.save(map_));
    matcher_ = std::make_unique<test::Program>(test::with_settings(
        "railfix-map-matcher",
        {"map_matcher.map=" + map_.string(), "map_matcher.curve_method=exits", "map_matcher.choose_track=false",
         "common.train_id=" + train_, "common.domain=" + std::to_string(kDomain), "common.log_level=error"}));
    ASSERT_TRUE(run_until(
        [&] { return states_.matched_readers() > 0 && steps_.matched_readers() > 0 && fixes_.matched_writers() > 0; }));
  }
  void TearDown() override { fs::remove(map_); }

  [[nodiscard]] static double place_m(int64_t tick) {
    return kBeginM + kSpeedMps * kPeriodS * static_cast<double>(tick);
  }
  [[nodiscard]] static int64_t stamp_ns(int64_t tick) {
    return core::to_ns(1000 + kPeriodS * static_cast<double>(tick));
  }

  /// The next state of the train, and the step of an odometry whose turning is that of the track lag_m behind the foot.
  void tick(double lag_m) {
    ++tick_;
    msg::TrainState state;
    state.stamp_ns(stamp_ns(tick_));
    state.edge(1);
    state.offset_m(place_m(tick_));
    state.distance_m(place_m(tick_));
    state.speed_mps(kSpeedMps);
    state.over_m(kPromisedM);
    state.under_m(kPromisedM);
    state.sigma_m(5);
    state.visual_scale(1);
    state.track_known(1);
    state.track_probability(1);
    state.direction(msg::DIRECTION_FORWARD);
    states_.write(state);
    const double step_m = kSpeedMps * kPeriodS;
    msg::OdometryStep step;
    step.stamp_ns(stamp_ns(tick_));
    step.reference_stamp_ns(stamp_ns(tick_ - 1));
    step.step_m(step_m);
    step.step_sigma_m(0.01);
    step.yaw_rad(step_m * line_.curvature_at(std::max(0.0, place_m(tick_) - 0.5 * step_m - lag_m)));
    step.yaw_sigma_rad(1e-4);
    step.distance_m(place_m(tick_));
    step.speed_mps(kSpeedMps);
    step.mode(msg::ODOMETRY_TRACK);
    step.valid(1);
    steps_.write(step);
    queue_.run_one(core::monotonic_ns() + 5'000'000);
  }

  const track::Alignment line_ = track::Alignment::chained(
      {0, 0, 0}, {{400, 0, 0}, {80, 0, 0.002}, {250, 0.002, 0.002}, {80, 0.002, 0}, {390, 0, 0}});
  const fs::path map_ = fs::temp_directory_path() / (train_ + ".map");
  int64_t tick_ = 0;
  std::vector<msg::PositionFix> said_;
  messaging::Writer<msg::TrainState> states_{participant_, topics::train_state};
  messaging::Writer<msg::OdometryStep> steps_{participant_, topics::odometry_step};
  messaging::Reader<msg::PositionFix> fixes_{participant_, topics::position_fix, "", queue_,
                                             [this](const msg::PositionFix& fix) { said_.push_back(fix); }};
  std::unique_ptr<test::Program> matcher_;
};

TEST_P(CurveExits, TheFixIsWithinItsSigmaWhateverTheLag) {
  while (place_m(tick_) < 900) tick(GetParam());
  ASSERT_TRUE(run_until([&] { return !said_.empty(); }));
  ASSERT_EQ(said_.size(), 1U);
  const msg::PositionFix& fix = said_.front();
  EXPECT_EQ(fix.kind(), msg::FIX_CURVATURE);
  EXPECT_EQ(fix.edge(), 1U);
  const double train_m = kBeginM + kSpeedMps * core::seconds(fix.stamp_ns() - stamp_ns(0));
  EXPECT_GT(train_m, 800);  // the curve ends at 810 m
  EXPECT_LT(std::abs(fix.offset_m() - train_m), 1.6 * fix.sigma_m());
  EXPECT_LT(std::abs(fix.offset_m() - train_m), 13);
}

INSTANTIATE_TEST_SUITE_P(Lags, CurveExits, ::testing::Values(0.0, 11.5, 20.0));

}  // namespace
}  // namespace railfix
