// Two tracks side by side, the train told on one of them: what lies between the rails says which one it is.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/time.hpp"
#include "core/units.hpp"
#include "map_matcher/map_matcher.hpp"

namespace railfix::map_matcher::beside_doubt_test {
namespace {

using testing::HasSubstr;
using track::LandmarkKind;

constexpr double kApartM = 4;
constexpr double kLengthM = 12000;
constexpr double kSpeedMps = 25;
constexpr double kPeriodS = 0.1;
constexpr uint32_t kTold = 2;  // the right one is 1

/// Balises on either track every 1.5 km, those of the told one 700 m further on; masts beside both every 60 m. The told
/// track may be drawn against the other one.
std::shared_ptr<track::Map> double_track(bool against) {
  auto map = std::make_shared<track::Map>();
  const auto right = track::Alignment::chained({0, 0, 0}, {{kLengthM, 0, 0}});
  const auto told = against ? track::Alignment::chained({kApartM, kLengthM, core::kPi}, {{kLengthM, 0, 0}})
                            : track::Alignment::chained({kApartM, 0, 0}, {{kLengthM, 0, 0}});
  map->edges = {{1, "right", 1, 2, "", right}, {kTold, "told", 3, 4, "", told}};
  uint32_t id = 0;
  const auto put = [&](uint32_t edge, LandmarkKind kind, double at_m, double lateral_m) {
    const bool turned = edge == kTold && against;
    map->landmarks.push_back(
        {++id, kind, edge, turned ? kLengthM - at_m : at_m, turned ? -lateral_m : lateral_m, 0.1, ""});
  };
  for (double m = 30; m < kLengthM; m += 60) {
    put(1, LandmarkKind::mast, m, 3);
    put(kTold, LandmarkKind::mast, m, 3);
  }
  for (double m = 500; m < kLengthM; m += 1500) {
    put(1, LandmarkKind::balise, m, 0);
    put(kTold, LandmarkKind::balise, m + 700, 0);
  }
  return map;
}

class Beside : public testing::TestWithParam<bool> {
 protected:
  void run_to(double at_m) {
    for (; at_m_ < at_m; at_m_ += kSpeedMps * kPeriodS) {
      stamp_ns_ += core::to_ns(kPeriodS);
      keep(matcher_->add(state()));
      keep(matcher_->add(StepInput{stamp_ns_, stamp_ns_ - core::to_ns(kPeriodS), true, kSpeedMps * kPeriodS, 0, 1e-4,
                                   at_m_, kSpeedMps}));
    }
  }
  void sight(LandmarkKind kind, double at_m) {
    run_to(at_m - 8);
    keep(matcher_->add(Sighting{stamp_ns_, kind, at_m - (at_m_ - kSpeedMps * kPeriodS), 0, 0.1, 0.95}));
    run_to(at_m + 30);
  }
  [[nodiscard]] StateInput state() const {
    StateInput state;
    const bool against = GetParam() && edge_ == kTold;
    state.placed.stamp_ns = stamp_ns_;
    state.placed.place = {edge_, against ? kLengthM - at_m_ : at_m_,
                          against ? track::Direction::reverse : track::Direction::forward};
    state.placed.speed_mps = kSpeedMps;
    state.placed.distance_m = at_m_ - count_from_m_;
    state.placed.over_m = behind_m_;
    state.placed.under_m = ahead_m_;
    state.sigma_m = 1;
    state.track_probability = probability_;
    state.pose = {edge_ == kTold ? kApartM : 0, at_m_, 0};
    state.track_known = state.usable = true;
    state.gnss_agrees = true;
    return state;
  }
  // Fusion says what it was told.
  void keep(const PlaceFixes& fixes) {
    for (const auto& fix : fixes) {
      if (fix.kind != FixKind::track) continue;
      probability_ = fix.options.front().probability;
      fits_ = fix.sightings_fit;
      EXPECT_EQ(fix.options.front().place.edge, edge_);
    }
  }

  std::shared_ptr<track::Map> map_ = double_track(GetParam());
  std::optional<MapMatcher> matcher_{std::in_place, MapMatcherParameters{}, map_};
  double at_m_ = 100;
  int64_t stamp_ns_ = core::kNsPerSecond;
  uint32_t edge_ = kTold;
  double count_from_m_ = 0;
  double behind_m_ = 5;
  double ahead_m_ = 5;
  double probability_ = 1;
  SightingsFit fits_ = SightingsFit::not_told;
};

TEST_P(Beside, BalisesOfTheNeighbourTakeTheToldTrackAwayAndOnesOfItsOwnGiveItBack) {
  run_to(450);
  EXPECT_GE(probability_, 0.999);
  sight(LandmarkKind::balise, 500);
  EXPECT_LT(probability_, 0.999) << "one may be the map's error, but the track is not declared";
  EXPECT_GT(probability_, 0.9);
  EXPECT_EQ(matcher_->trouble(), "");
  sight(LandmarkKind::balise, 2000);
  sight(LandmarkKind::balise, 3500);
  EXPECT_LT(probability_, 0.5) << "though GNSS agrees";
  EXPECT_EQ(fits_, SightingsFit::not_told) << "the place along the track is right";
  EXPECT_THAT(matcher_->trouble(), HasSubstr("told on the wrong track"));
  for (const double at_m : {4200.0, 5700.0, 7200.0, 8700.0}) sight(LandmarkKind::balise, at_m);
  EXPECT_GE(probability_, 0.999);
  EXPECT_EQ(matcher_->trouble(), "");
}

// A fusion that is started anew counts from 0 and is handed the place; an operator tells another track.
TEST_P(Beside, AFusionThatIsStartedAnewKeepsTheDoubtAndAnotherTrackThatIsToldEndsIt) {
  for (const double at_m : {500.0, 2000.0, 3500.0}) sight(LandmarkKind::balise, at_m);
  count_from_m_ = at_m_;
  run_to(at_m_ + 200);
  EXPECT_LT(probability_, 0.5);
  edge_ = 1;
  probability_ = 1;
  count_from_m_ = at_m_;
  run_to(at_m_ + 200);
  EXPECT_GE(probability_, 0.999);
  EXPECT_EQ(matcher_->trouble(), "");
}

// Who begins with what was said would take the rest for that of another leg.
TEST_P(Beside, HoweverManyThereAreNoOtherTrackIsDeclaredByWhatIsLeft) {
  for (double at_m = 500; at_m < kLengthM - 200; at_m += 1500) sight(LandmarkKind::balise, at_m);
  EXPECT_LT(probability_, 0.1);
  EXPECT_GT(probability_, 0.002);
}

// The train may be 20 m further on than it thinks, and hardly further back.
TEST_P(Beside, TheWindowIsThatOfATrainThatLooksAhead) {
  behind_m_ = 2;
  ahead_m_ = 40;
  sight(LandmarkKind::balise, 500 - 30);
  EXPECT_LT(probability_, 0.999);
  probability_ = 1;
  matcher_.emplace(MapMatcherParameters{}, map_);
  sight(LandmarkKind::balise, 2000 + 30);
  EXPECT_GE(probability_, 0.999);
}

// In a station the neighbour may have more of them.
TEST_P(Beside, WhereBothTracksHaveOneItSaysNothing) {
  for (const double m : {495.0, 500.0, 505.0}) {
    const double at_m = GetParam() ? kLengthM - m : m;
    map_->landmarks.push_back(
        {static_cast<uint32_t>(map_->landmarks.size() + 1), LandmarkKind::balise, kTold, at_m, 0, 0.1, ""});
    map_->landmarks.push_back(
        {static_cast<uint32_t>(map_->landmarks.size() + 1), LandmarkKind::balise, 1, m + 2, 0, 0.1, ""});
  }
  matcher_.emplace(MapMatcherParameters{}, map_);
  sight(LandmarkKind::balise, 500);
  EXPECT_GE(probability_, 0.9999);
}

TEST_P(Beside, WhatNeitherTrackHasAndAllOfOneGroupAreLittle) {
  for (const double at_m : {300.0, 900.0, 1700.0, 2500.0, 3100.0}) sight(LandmarkKind::balise, at_m);
  EXPECT_GE(probability_, 0.999);
  for (const double m : {5003.0, 5006.0, 5009.0})
    map_->landmarks.push_back(
        {static_cast<uint32_t>(map_->landmarks.size() + 1), LandmarkKind::balise, 1, m, 0, 0.1, ""});
  matcher_.emplace(MapMatcherParameters{}, map_);
  for (const double at_m : {5000.0, 5003.0, 5006.0, 5009.0}) {
    run_to(at_m - 8);
    keep(matcher_->add(Sighting{stamp_ns_, LandmarkKind::balise, 8, 0, 0.1, 0.95}));
  }
  run_to(5050);
  EXPECT_GT(probability_, 0.9);
}

TEST_P(Beside, MastsAndAForeignBaliseFarToTheSideSayNothing) {
  sight(LandmarkKind::mast, 510);
  for (const double at_m : {500.0, 2000.0, 3500.0}) {
    run_to(at_m - 8);
    keep(matcher_->add(Sighting{stamp_ns_, LandmarkKind::balise, 8, -kApartM, 0.1, 0.95}));
    run_to(at_m + 30);
  }
  EXPECT_GE(probability_, 0.999);
}

INSTANTIATE_TEST_SUITE_P(Drawn, Beside, testing::Bool(),
                         [](const auto& drawn) { return drawn.param ? "Against" : "Along"; });

}  // namespace
}  // namespace railfix::map_matcher::beside_doubt_test
