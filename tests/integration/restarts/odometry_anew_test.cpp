// Another odometry takes over, or one that comes late: what map_matcher says of the track stays true.
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
    EXPECT_NEAR(kEdgeM + fix.offset_m(), train_m, 0.5) << "edge " << fix.edge();
  }
}

class OdometryLate : public ::testing::Test, public test::OnMapMatcher {
 protected:
  OdometryLate() : OnMapMatcher("odometry-late", kDomain, {.speed_mps = kSpeedMps, .begin_m = kEdgeM - 50}) {}
  // Two tracks that nothing tells apart: the choice stays open.
  void SetUp() override {
    track::Map map;
    map.edges.push_back({1, "before", 1, 2, "", track::Alignment::chained({0, 0, 0}, {{kEdgeM, 0, 0}})});
    map.edges.push_back({2, "left", 2, 3, "", track::Alignment::chained({0, kEdgeM, 0}, {{kEdgeM, 0, 0}})});
    map.edges.push_back({3, "right", 2, 4, "", track::Alignment::chained({0, kEdgeM, 0}, {{kEdgeM, 0, 0}})});
    map.connections = {{2, 1, 2, false}, {2, 1, 3, false}};
    ASSERT_TRUE(start_matcher(map));
  }
  void tick() {
    ++tick_;
    const bool behind = way_m() < kEdgeM;
    states_.write(
        state(behind ? track::EdgePosition{1, way_m()} : track::EdgePosition{2, way_m() - kEdgeM}, kPromisedM));
  }
};

TEST_F(OdometryLate, ThePlaceIsSaidForItsOwnTime) {
  for (int n = 0; n < 80; ++n) {
    tick();
    steps_.write(step());
    match();
  }
  const auto late = step();
  for (int n = 0; n < 12; ++n) {
    tick();
    match();
  }
  const size_t said_before = said_.size();
  tick();
  steps_.write(late);
  match();
  ASSERT_GT(said_.size(), said_before);
  for (const auto& fix : said_) {
    const double on_edge_m = way_m(fix.stamp_ns()) - (fix.edge() == 1U ? 0 : kEdgeM);
    EXPECT_NEAR(fix.offset_m(), on_edge_m, 0.5) << "edge " << fix.edge();
  }
}

}  // namespace
}  // namespace railfix
