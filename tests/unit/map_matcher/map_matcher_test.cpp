// The map matcher as a whole, without DDS: a train runs over a switch.
#include "map_matcher/map_matcher.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <iterator>
#include <string>

#include "core/time.hpp"
#include "unit/map_matcher/fork_map.hpp"

namespace railfix::map_matcher::map_matcher_test {
namespace {

using testing::HasSubstr;

constexpr double kSpeedMps = 20;
constexpr double kPeriodS = 0.1;

/// Straight on from 300 m on the stem.
class MapMatcherRide : public testing::Test {
 protected:
  void run_to(double at_m) {
    for (; at_m_ < at_m; at_m_ += kSpeedMps * kPeriodS) {
      stamp_ns_ += core::to_ns(kPeriodS);
      keep(matcher_.add(state()));
      keep(matcher_.add(step()));
    }
  }
  [[nodiscard]] StateInput state() const {
    const double way_m = at_m_ - kFromM;
    StateInput state;
    state.placed = {stamp_ns_, place(at_m_), kSpeedMps, way_m, 3, 3};
    state.sigma_m = 0.7;
    state.track_probability = 1;
    state.pose.northing_m = at_m_;
    state.track_known = known_;
    return state;
  }
  [[nodiscard]] StepInput step() const {
    const double step_m = kSpeedMps * kPeriodS;
    return {stamp_ns_, stamp_ns_ - core::to_ns(kPeriodS), true, step_m, 0, 1e-4, at_m_ - kFromM, kSpeedMps};
  }
  /// By fusion, which goes on straight until it is told otherwise.
  [[nodiscard]] static track::EdgePosition place(double at_m) {
    const bool on_stem = at_m < 500;
    return {on_stem ? 1U : 2U, on_stem ? at_m : at_m - 500, track::Direction::forward};
  }
  void keep(const PlaceFixes& fixes) { said_.insert(said_.end(), fixes.begin(), fixes.end()); }
  [[nodiscard]] const PlaceFix* last(FixKind kind) const {
    const auto found = std::find_if(said_.rbegin(), said_.rend(), [&](const auto& fix) { return fix.kind == kind; });
    return found == said_.rend() ? nullptr : &*found;
  }

  static constexpr double kFromM = 300;
  MapMatcher matcher_{{}, fork()};
  double at_m_ = kFromM;
  int64_t stamp_ns_ = core::kNsPerSecond;
  bool known_ = true;
  PlaceFixes said_;
};

TEST_F(MapMatcherRide, SaysTheTrackBehindTheSwitchAndTheFrogsPlace) {
  run_to(510);
  keep(matcher_.add(Sighting{stamp_ns_, track::LandmarkKind::frog, 20, 0.72, 0.1, 0.99}));
  run_to(600);
  const auto* track = last(FixKind::track);
  ASSERT_NE(track, nullptr);
  EXPECT_EQ(track->options.front().place.edge, 2U);
  EXPECT_GT(track->options.front().probability, 0.999);
  EXPECT_EQ(track->sightings_fit, SightingsFit::not_told);
  EXPECT_FALSE(std::isfinite(track->sigma_m));
  const auto* frog = last(FixKind::landmark);
  ASSERT_NE(frog, nullptr);
  EXPECT_EQ(frog->landmark, 1U);
  EXPECT_EQ(frog->options.front().place.edge, 2U);
  EXPECT_NEAR(frog->options.front().place.offset_m, 10, 2);
  EXPECT_EQ(matcher_.trouble(), "");
}

// What stands beside the track is told after it has left the picture, as of the picture that showed it nearest.
TEST_F(MapMatcherRide, WhatWasSightedAWhileAgoCountsFromWhereTheTrainWasThen) {
  std::vector<double> probabilities;
  for (const double late_s : {0.0, 0.4}) {
    matcher_ = MapMatcher({}, fork());
    at_m_ = kFromM;
    said_.clear();
    run_to(510);
    const int64_t then_ns = stamp_ns_ - core::to_ns(late_s);
    keep(matcher_.add(Sighting{then_ns, track::LandmarkKind::frog, 20 + kSpeedMps * late_s, 0.72, 0.1, 0.99}));
    const auto* frog = last(FixKind::landmark);
    ASSERT_NE(frog, nullptr) << late_s;
    EXPECT_EQ(frog->stamp_ns, then_ns);
    EXPECT_EQ(frog->options.front().place.edge, 2U);
    EXPECT_NEAR(frog->options.front().place.offset_m, 10 - kSpeedMps * late_s, 2);
    run_to(514);
    ASSERT_NE(last(FixKind::track), nullptr);
    probabilities.push_back(last(FixKind::track)->options.front().probability);
  }
  EXPECT_NEAR(probabilities[0], probabilities[1], 1e-9);
}

// Its place is where it lies if the train is on that leg, and nobody knows that.
TEST_F(MapMatcherRide, WhatOneLegAloneHasIsNoFixWhileTheLegIsNotKnown) {
  for (const bool both : {false, true}) {
    auto map = std::make_shared<track::Map>(*fork());
    map->landmarks = {{1, track::LandmarkKind::mast, 2, 200, 3, 0.1, ""}};
    // Beside a parallel leg as well.
    map->edges[2].alignment = track::Alignment::chained({-4, 500, 0}, {{500, 0, 0}});
    if (both) map->landmarks.push_back({2, track::LandmarkKind::mast, 3, 200, 3, 0.1, ""});
    matcher_ = MapMatcher({}, map);
    at_m_ = kFromM;
    said_.clear();
    run_to(480);
    for (; at_m_ < 690; at_m_ += kSpeedMps * kPeriodS) {  // in the dark
      stamp_ns_ += core::to_ns(kPeriodS);
      keep(matcher_.add(state()));
    }
    keep(matcher_.add(Sighting{stamp_ns_, track::LandmarkKind::mast, 700 - at_m_, 3, 0.1, 0.95}));
    const auto* mast = last(FixKind::landmark);
    ASSERT_NE(mast, nullptr);
    EXPECT_EQ(mast->options.front().probability > 0.9, both) << mast->options.front().probability;
  }
}

TEST_F(MapMatcherRide, ASearchedPlaceIsSaidByGnssOnTheOneTrackThereIs) {
  known_ = false;
  run_to(302);
  EXPECT_THAT(matcher_.trouble(), HasSubstr("not known yet"));
  ASSERT_TRUE(matcher_.wants_gnss());
  while (at_m_ < 450) {
    run_to(at_m_ + 10);
    keep(matcher_.add(GnssInput{2, at_m_ - kSpeedMps * kPeriodS, 1, stamp_ns_}));
  }
  const auto* found = last(FixKind::gnss);
  ASSERT_NE(found, nullptr);
  EXPECT_EQ(found->options.front().place.edge, 1U);
  EXPECT_NEAR(found->options.front().place.offset_m,
              core::seconds(found->stamp_ns - core::kNsPerSecond) * kSpeedMps + 298, 1);
  EXPECT_TRUE(matcher_.add(GnssInput{2, at_m_, 5, stamp_ns_}).empty()) << "of where it was while GNSS was good";
  known_ = true;
  run_to(460);
  EXPECT_FALSE(matcher_.wants_gnss());
  EXPECT_EQ(matcher_.trouble(), "");
}

TEST_F(MapMatcherRide, AStateOfAnotherMapIsNamedAndNothingIsMatchedThere) {
  const auto frog = [&] { return matcher_.add(Sighting{stamp_ns_, track::LandmarkKind::frog, 20, 0.72, 0.1, 0.99}); };
  run_to(510);
  EXPECT_FALSE(frog().empty());
  auto elsewhere = state();
  elsewhere.pose.easting_m = 7000;
  EXPECT_TRUE(matcher_.add(elsewhere).empty());
  EXPECT_THAT(matcher_.trouble(), HasSubstr("another map"));
  EXPECT_TRUE(matcher_.add(step()).empty());
  EXPECT_TRUE(frog().empty());
}

/// What a camera says that does not measure: nothing, or (frozen: its picture stands still; drifts, and fusion knows
/// it) something wrong.
enum class Camera : uint8_t { none, blind, frozen, drifts };

/// A line with a curve of 600 m to the left from 500 m on; the train is 12 m further than fusion thinks.
class ShapeInTheDark : public testing::TestWithParam<Camera> {
 protected:
  static std::shared_ptr<const track::Map> line() {
    auto map = std::make_shared<track::Map>();
    map->edges = {{1, "line", 1, 2, "",
                   track::Alignment::chained(
                       {0, 0, 0}, {{500, 0, 0}, {80, 0, kArc}, {200, kArc, kArc}, {80, kArc, 0}, {1500, 0, 0}})}};
    map->nodes = {{1, track::NodeKind::end, "", 0, 0}, {2, track::NodeKind::end, "", 0, 0}};
    return map;
  }
  static MapMatcherParameters without_lag() {
    MapMatcherParameters parameters;
    parameters.lag_m = 0;
    return parameters;
  }
  static StepInput step(Camera camera, int64_t from_ns, int64_t to_ns) {
    StepInput step{to_ns, from_ns};
    step.measured = camera != Camera::blind;
    if (camera == Camera::drifts) {
      step.speed_mps = 0.9 * kSpeedMps;
      step.step_m = step.speed_mps * kPeriodS;
      step.distance_m = step.speed_mps * core::seconds(to_ns - core::kNsPerSecond);
    }
    return step;
  }
  /// What the shape tells.
  PlaceFixes ride(Camera camera, bool gyro) {
    const auto& alignment = map_->edges.front().alignment;
    PlaceFixes fixes;
    for (int i = 1; i * kPeriodS * kSpeedMps < kRideM; ++i) {
      const auto ns = [&](double t_s) { return core::kNsPerSecond + core::to_ns(t_s); };
      for (int k = 1; gyro && k <= 5; ++k) {
        const double t_s = (i - 1 + 0.2 * k) * kPeriodS;
        matcher_.add(GyroInput{kSpeedMps * alignment.at(100 + kSpeedMps * t_s).curvature_per_m + kBiasRps, ns(t_s)});
      }
      const double at_m = 100 + kSpeedMps * i * kPeriodS;
      StateInput state;
      state.placed = {ns(i * kPeriodS), {1, at_m - kOffM, track::Direction::forward}, kSpeedMps, at_m - 100, 30, 30};
      state.track_probability = 1;
      state.sigma_m = 7;
      state.track_known = true;
      state.camera_agrees = camera != Camera::drifts;
      state.pose = alignment.at(at_m - kOffM).pose;
      auto said = matcher_.add(state);
      if (camera != Camera::none) {
        const auto more = matcher_.add(step(camera, ns((i - 1) * kPeriodS), ns(i * kPeriodS)));
        said.insert(said.end(), more.begin(), more.end());
      }
      std::ranges::copy_if(said, std::back_inserter(fixes),
                           [](const PlaceFix& fix) { return fix.kind == FixKind::curvature; });
    }
    return fixes;
  }
  static double error_m(const PlaceFix& fix) {
    const double at_m = 100 + kSpeedMps * core::seconds(fix.stamp_ns - core::kNsPerSecond);
    return fix.options.front().place.offset_m - at_m;
  }
  static constexpr double kArc = 1.0 / 600;
  static constexpr double kOffM = 12;
  static constexpr double kRideM = 1003;  // no whole number of the matcher's bins
  static constexpr double kBiasRps = 0.002;
  std::shared_ptr<const track::Map> map_ = line();
  MapMatcher matcher_{without_lag(), map_};
};

TEST_P(ShapeInTheDark, IsThatOfTheGyroAlongFusionsWay) {
  const auto fixes = ride(GetParam(), true);
  EXPECT_GE(fixes.size(), 2U) << "where the curve begins and where it ends";
  for (const auto& fix : fixes) EXPECT_LT(std::abs(error_m(fix)), std::min(6.0, 2 * fix.sigma_m));
}

TEST_P(ShapeInTheDark, IsToldAlikeWhenTheRideIsPlayedOnceMore) {
  const auto first = ride(GetParam(), true);
  matcher_.restart();
  const auto again = ride(GetParam(), true);
  ASSERT_EQ(first.size(), again.size());
  for (size_t i = 0; i < first.size(); ++i) {
    EXPECT_EQ(first[i].stamp_ns, again[i].stamp_ns);
    EXPECT_EQ(error_m(first[i]), error_m(again[i]));
    EXPECT_EQ(first[i].sigma_m, again[i].sigma_m);
  }
}

TEST_P(ShapeInTheDark, IsNotToldWithoutAGyro) {
  EXPECT_TRUE(ride(GetParam(), false).empty());
}

std::string name_of(const testing::TestParamInfo<Camera>& one) {
  static const std::array<std::string, 4> names{"None", "Blind", "Frozen", "Drifts"};
  return names.at(static_cast<size_t>(one.param));
}

INSTANTIATE_TEST_SUITE_P(Cameras, ShapeInTheDark,
                         testing::Values(Camera::none, Camera::blind, Camera::frozen, Camera::drifts), name_of);

TEST(MapMatcher, WithoutAMapSaysWhy) {
  MapMatcher matcher({}, nullptr);
  EXPECT_TRUE(matcher.add(StateInput{}).empty());
  EXPECT_EQ(matcher.trouble(), "no map is configured");
  EXPECT_TRUE(matcher.add(StepInput{}).empty());
  EXPECT_FALSE(matcher.wants_gnss());
}

}  // namespace
}  // namespace railfix::map_matcher::map_matcher_test
