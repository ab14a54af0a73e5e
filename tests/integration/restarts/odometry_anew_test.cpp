// Another odometry takes over from one that has counted for kilometres: what map_matcher says of the track stays true.
#include <gmock/gmock.h>

#include "support/on_map_matcher.hpp"

namespace railfix {
namespace {

constexpr int kDomain = 82;
constexpr double kSpeedMps = 10;
constexpr double kEdgeM = 3000;
constexpr double kBeginM = kEdgeM + 100;  // of the data, on the way of both edges
constexpr double kCountedM = 2900;        // by the first odometry until then
constexpr double kPromisedM = 2;

class OdometryAnew : public ::testing::Test, public test::OnMapMatcher {
 protected:
  OdometryAnew() : OnMapMatcher("odometry-anew", kDomain, {.speed_mps = kSpeedMps, .begin_m = kBeginM}) {}
  void SetUp() override {
    track::Map map;
    map.edges.push_back({1, "behind", 1, 2, "", track::Alignment::chained({0, 0, 0}, {{kEdgeM, 0, 0}})});
    map.edges.push_back({2, "here", 2, 3, "", track::Alignment::chained({0, kEdgeM, 0}, {{kEdgeM, 0, 0}})});
    map.connections = {{2, 1, 2, false}};
    ASSERT_TRUE(start_matcher(map));
  }

  /// The next state of the train and, `counted_m` not being NaN, the next step of an odometry that has counted so far.
  void tick(double counted_m) {
    ++tick_;
    msg::TrainState here = state({2, way_m() - kEdgeM}, kPromisedM);
    here.distance_m(kCountedM + way_m() - kBeginM);
    states_.write(here);
    if (!std::isnan(counted_m)) {
      msg::OdometryStep counted = step();
      counted.distance_m(counted_m);
      steps_.write(counted);
    }
    match();
  }
  void ride(double seconds, double counted_m) {
    for (double t_s = 0; t_s < seconds; t_s += kPeriodS) tick(counted_m += kSpeedMps * kPeriodS);
  }
};

TEST_F(OdometryAnew, TheTrackIsSaidWhereTheTrainIs) {
  ride(5, kCountedM);
  ride(5, 0);     // warm already, beside the one before
  ride(10, NAN);  // nobody
  ride(5, 0);
  ASSERT_FALSE(said_.empty());
  EXPECT_GT(said_.back().stamp_ns(), stamp_ns(tick_ - 12));
  EXPECT_GT(said_.size(), 15U) << "one a second";
  for (const auto& fix : said_) {
    const double train_m = way_m(fix.stamp_ns());
    EXPECT_EQ(fix.kind(), msg::FIX_TRACK);
    EXPECT_EQ(fix.edge(), 2U) << "at " << train_m;
    EXPECT_NEAR(kEdgeM + fix.offset_m(), train_m, 3) << "edge " << fix.edge();
  }
}

}  // namespace
}  // namespace railfix
