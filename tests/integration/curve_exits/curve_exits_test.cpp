// The baseline of paper 004 in service: map_matcher with `curve_method: exits` tells where the train is behind a curve,
// though the body turns anywhere up to lag_m behind the camera's foot, and says how sure that is.
#include <gmock/gmock.h>

#include "support/on_map_matcher.hpp"

namespace railfix {
namespace {

constexpr int kDomain = 94;
constexpr double kPromisedM = 25;

class CurveExits : public ::testing::TestWithParam<double>, public test::OnMapMatcher {
 protected:
  CurveExits() : OnMapMatcher("curve-exits", kDomain, {.speed_mps = 20, .begin_m = 50}) {}
  void SetUp() override {
    track::Map map;
    map.edges.push_back({1, "line", 1, 2, "", line_});
    ASSERT_TRUE(start_matcher(map, {"map_matcher.curve_method=exits", "map_matcher.choose_track=false"}));
  }

  /// The next state of the train, and the step of an odometry whose turning is that of the track lag_m behind the foot.
  void tick(double lag_m) {
    ++tick_;
    states_.write(state({1, way_m()}, kPromisedM));
    msg::OdometryStep turned = step();
    turned.yaw_rad(turned.step_m() * line_.curvature_at(std::max(0.0, way_m() - 0.5 * turned.step_m() - lag_m)));
    steps_.write(turned);
    match();
  }

  const track::Alignment line_ = track::Alignment::chained(
      {0, 0, 0}, {{400, 0, 0}, {80, 0, 0.002}, {250, 0.002, 0.002}, {80, 0.002, 0}, {390, 0, 0}});
};

TEST_P(CurveExits, TheFixIsWithinItsSigmaWhateverTheLag) {
  while (way_m() < 900) tick(GetParam());
  ASSERT_EQ(said_.size(), 1U);
  const msg::PositionFix& fix = said_.front();
  EXPECT_EQ(fix.kind(), msg::FIX_CURVATURE);
  EXPECT_EQ(fix.edge(), 1U);
  const double train_m = way_m(fix.stamp_ns());
  EXPECT_GT(train_m, 800);  // the curve ends at 810 m
  EXPECT_LT(std::abs(fix.offset_m() - train_m), 1.6 * fix.sigma_m());
  EXPECT_LT(std::abs(fix.offset_m() - train_m), 13);
}

INSTANTIATE_TEST_SUITE_P(Lags, CurveExits, ::testing::Values(0.0, 11.5, 20.0));

}  // namespace
}  // namespace railfix
