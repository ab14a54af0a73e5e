// Ways of different length that lead to the same track: the interval holds the train over each of them.
#include <gtest/gtest.h>

#include "fusion/handover.hpp"
#include "straight_run.hpp"

namespace railfix::fusion {
namespace {

track::Alignment northwards(double from_m, double length_m) {
  return track::Alignment::chained({0, from_m, 0}, {{length_m, 0, 0}});
}
FixInput track_fix(double t_s, uint32_t edge, double offset_m) {
  return {at(t_s), edge, offset_m, INFINITY, 1.0, 0, FixKind::track, track::Direction::forward, nullptr};
}
FixInput landmark_fix(double t_s, uint32_t edge, double offset_m, uint32_t landmark) {
  return {
      at(t_s),           edge, offset_m, 0.1, 0.9999, landmark, FixKind::landmark, track::Direction::forward, nullptr,
      SightingsFit::here};
}

/// A stem of 1000 m, a straight leg of 400 m, a siding that is longer, and on from where they meet.
Fusion at_a_loop(std::vector<track::Landmark> landmarks = {}, double longer_m = 60) {
  auto map = std::make_shared<track::Map>();
  map->edges = {{1, "stem", 1, 2, "", northwards(0, 1000)},
                {2, "straight", 2, 3, "", northwards(1000, 400)},
                {3, "siding", 2, 3, "", northwards(1000, 400 + longer_m)},
                {4, "on", 3, 4, "", northwards(1400, 4000)}};
  map->connections = {{2, 1, 2, false}, {2, 1, 3, true}, {3, 2, 4, false}, {3, 3, 4, true}};
  map->landmarks = std::move(landmarks);
  return core::value_or_throw(Fusion::create({}, map, track::EdgePosition{1, 900, track::Direction::forward}));
}

TEST(OtherWays, WhereLegsHaveMetTheIntervalHoldsBothUntilLandmarksAgree) {
  auto fusion = at_a_loop();
  run(fusion, 0, 0.5, 20);
  fusion.add(landmark_fix(0.5, 1, 910, 1));
  const auto before = run(fusion, 0.5, 29.9, 20);
  EXPECT_NEAR(before.over_m, before.under_m, 1);
  auto both = track_fix(29.9, 4, 98);
  both.otherwise.behind_m = 60;
  fusion.add(both);
  auto state = run(fusion, 29.9, 30.5, 20);
  EXPECT_EQ(state.position.edge, 4U);
  EXPECT_EQ(state.track_probability, 1) << "there is only this one";
  EXPECT_NEAR(state.over_m, state.under_m + 60, 1);
  fusion.add(track_fix(30.5, 4, 110));
  state = run(fusion, 30.5, 30.6, 20);
  EXPECT_NEAR(state.over_m, state.under_m + 60, 1) << "who does not name the other way may have begun anew";
  fusion.add(landmark_fix(30.6, 4, 112, 2));
  state = run(fusion, 30.6, 31.5, 20);
  fusion.add(landmark_fix(31.5, 4, 130, 3));
  state = run(fusion, 31.5, 32, 20);
  EXPECT_LT(state.over_m, 5) << "came over the straight leg";
}

TEST(OtherWays, ALandmarkThatHasATwinAsFarAsTheWaysDifferTellsNothing) {
  const auto balise = track::LandmarkKind::balise;
  auto fusion = at_a_loop({{1, balise, 4, 50, 0, 0.1, ""},
                           {2, balise, 4, 110, 0, 0.1, ""},
                           {3, balise, 4, 150, 0, 0.1, ""},
                           {4, balise, 4, 200, 0, 0.1, ""}});
  run(fusion, 0, 29.9, 20);
  auto both = track_fix(29.9, 4, 98);
  both.otherwise.behind_m = 60;
  fusion.add(both);
  run(fusion, 29.9, 30.5, 20);
  fusion.add(landmark_fix(30.5, 4, 110, 2));
  EXPECT_GT(run(fusion, 30.5, 31.5, 20).over_m, 60) << "it may have been the first one";
  run(fusion, 31.5, 32.5, 20);
  fusion.add(landmark_fix(32.5, 4, 150, 3));
  run(fusion, 32.5, 35, 20);
  fusion.add(landmark_fix(35, 4, 200, 4));
  EXPECT_LT(run(fusion, 35, 36, 20).over_m, 20) << "none stands there over the siding";
}

// It is no contradiction: neither a place that was wrong nor a scale. Landmarks lie `apart_m` from each other.
void expect_found_over(double longer_m, bool over_siding, double apart_m) {
  std::vector<track::Landmark> landmarks;
  for (uint32_t i = 1; i <= 8; ++i)
    landmarks.push_back({i, track::LandmarkKind::balise, 4, 100 + i * apart_m, 0, 0, ""});
  auto fusion = at_a_loop(landmarks, longer_m);
  run(fusion, 0, 0.5, 20);
  fusion.add(landmark_fix(0.5, 1, 910, 100));
  run(fusion, 0.5, 29.9, 20);
  auto both = track_fix(29.9, 4, 98);  // over the straight leg
  both.otherwise.behind_m = longer_m;
  fusion.add(both);
  double t_s = 29.9;
  TrainEstimate state;
  for (const auto& landmark : landmarks) {
    const double there_s = 29.9 + (landmark.offset_m - 98 + (over_siding ? longer_m : 0)) / 20;
    state = run(fusion, t_s, there_s, 20);
    EXPECT_LT(state.position.offset_m - landmark.offset_m, state.over_m + 0.4) << landmark.id;  // a step's way
    EXPECT_LT(landmark.offset_m - state.position.offset_m, state.under_m + 0.4) << landmark.id;
    fusion.add(landmark_fix(there_s, 4, landmark.offset_m, landmark.id));
    t_s = there_s;
  }
  EXPECT_EQ(state.integrity, Integrity::ok) << state.reason;
  EXPECT_LT(state.over_m + state.under_m, 10);
  EXPECT_NEAR(state.visual_scale, 1, 1e-3);
}

TEST(OtherWays, ALandmarkSaysWhichWayTheTrainCameAndNothingAgainstTheScales) {
  for (const double longer_m : {4.0, 30.0, 60.0}) {
    for (const double apart_m : {70.0, 230.0, 400.0}) {
      for (const bool over_siding : {false, true}) {
        SCOPED_TRACE(testing::Message() << longer_m << " m longer, landmarks every " << apart_m << " m, siding "
                                        << over_siding);
        expect_found_over(longer_m, over_siding, apart_m);
      }
    }
  }
}

// The second leg is beyond another one that was declared as late.
TEST(OtherWays, WhatOneTrackWasJoinedByStaysWhenTheNextOneIs) {
  auto map = std::make_shared<track::Map>();
  map->edges = {{1, "stem", 1, 2, "", northwards(0, 1000)},           {2, "main", 2, 3, "", northwards(1000, 9000)},
                {3, "first", 2, 4, "", northwards(1000, 300)},        {4, "bypass", 2, 5, "", northwards(1000, 430)},
                {5, "of the first", 4, 5, "", northwards(1300, 100)}, {6, "yard", 5, 6, "", northwards(1400, 500)},
                {7, "on", 6, 7, "", northwards(1900, 3000)},          {8, "left", 6, 8, "", northwards(1900, 3000)}};
  map->connections = {{2, 1, 2, false}, {2, 1, 3, true}, {2, 1, 4, true},  {4, 3, 5, false},
                      {5, 5, 6, false}, {5, 4, 6, true}, {6, 6, 7, false}, {6, 6, 8, true}};
  auto fusion = core::value_or_throw(Fusion::create({}, map, track::EdgePosition{1, 900, track::Direction::forward}));
  run(fusion, 0, 40, 20);
  fusion.add(track_fix(40, 6, 300));
  auto state = run(fusion, 40, 55, 20);
  EXPECT_NEAR(state.over_m, state.under_m + 30, 1);
  fusion.add(track_fix(55, 8, 100));
  state = run(fusion, 55, 56, 20);
  EXPECT_EQ(state.position.edge, 8U);
  EXPECT_NEAR(state.over_m, state.under_m + 30, 1);
}

TEST(OtherWays, WhoSaysAnotherPlaceOnTheSameTrackMayBeRight) {
  auto fusion = at_a_loop();
  run(fusion, 0, 30, 20);
  fusion.add(track_fix(30, 4, 40));  // fusion is at 100
  const auto state = run(fusion, 30, 30.5, 20);
  EXPECT_NEAR(state.over_m, state.under_m + 60, 1);
}

/// Points at 1000 m: straight on, or over one of two chains of another length to a yard.
Fusion before_a_throat(double longer_m) {
  auto map = std::make_shared<track::Map>();
  map->edges = {
      {1, "stem", 1, 2, "", northwards(0, 1000)},           {2, "main", 2, 3, "", northwards(1000, 9000)},
      {3, "first", 2, 4, "", northwards(1000, 300)},        {4, "bypass", 2, 5, "", northwards(1000, 400 + longer_m)},
      {5, "of the first", 4, 5, "", northwards(1300, 100)}, {6, "yard", 5, 6, "", northwards(1400, 3000)}};
  map->connections = {{2, 1, 2, false}, {2, 1, 3, true},  {2, 1, 4, true},
                      {4, 3, 5, false}, {5, 5, 6, false}, {5, 4, 6, true}};
  return core::value_or_throw(Fusion::create({}, map, track::EdgePosition{1, 900, track::Direction::forward}));
}

TEST(OtherWays, ATrackThatIsDeclaredLateIsJoinedByTheWayThatWasRun) {
  for (const double longer_m : {30.0, 200.0}) {
    for (const bool over_bypass : {false, true}) {
      auto fusion = before_a_throat(longer_m);
      run(fusion, 0, 40, 20);  // 1700 m
      const double offset_m = over_bypass ? 300 - longer_m : 300;
      fusion.add(track_fix(40, 6, offset_m));
      const auto state = run(fusion, 40, 41, 20);
      EXPECT_EQ(state.position.edge, 6U);
      EXPECT_NEAR(state.position.offset_m, offset_m + 20, 0.5) << longer_m << over_bypass;
      // A difference that could be mistaken is held, one that the way run excludes is not.
      const double held_m = longer_m < 100 ? longer_m : 0;
      EXPECT_NEAR(over_bypass ? state.under_m - state.over_m : state.over_m - state.under_m, held_m, 1);
    }
  }
}

TEST(OtherWays, RoundABalloonTheOtherLegIsBesideTheTrainAndNotElsewhere) {
  auto map = std::make_shared<track::Map>();
  map->edges = {{1, "stem", 1, 2, "", northwards(0, 1000)},
                {2, "right", 2, 3, "", northwards(1000, 800)},
                {3, "left", 2, 3, "", northwards(1000, 800)}};
  map->connections = {{2, 1, 2, false}, {2, 1, 3, true}, {3, 2, 3, false}};
  map->edges[1].is_drawn = map->edges[2].is_drawn = true;
  auto fusion = core::value_or_throw(Fusion::create({}, map, track::EdgePosition{1, 900, track::Direction::forward}));
  run(fusion, 0, 7, 20);
  fusion.add(track_fix(7, 3, 40));
  const auto state = run(fusion, 7, 8, 20);
  EXPECT_EQ(fusion.counts().elsewhere, 0U);
  EXPECT_EQ(state.position.edge, 3U);
  EXPECT_EQ(state.track_probability, 1);
}

// As it may have set back clear of points that are thrown now, by a little less than it thinks.
TEST(OtherWays, AFusionThatTakesAPlaceBesidePointsOverDoesNotKnowTheLeg) {
  auto map = std::make_shared<track::Map>();
  map->edges = {{1, "stem", 1, 2, "", northwards(0, 1000)},
                {2, "straight", 2, 3, "", northwards(1000, 1000)},
                {3, "left", 2, 4, "", track::Alignment::chained({0, 1000, 0}, {{1000, 0.001, 0.001}})}};
  map->connections = {{2, 1, 2, false}, {2, 1, 3, true}};
  const auto taken_over = [&](double offset_m) {
    KnownPlace known;
    known.stamp_ns = at(0);
    known.position = {2, offset_m, track::Direction::forward};
    known.over_m = known.under_m = 9;
    known.track_probability = 1;
    auto fusion = core::value_or_throw(Fusion::create({}, map, std::nullopt));
    run(fusion, -1, 0, 0);
    const auto place = place_at(map, known, at(0), FusionParameters().interval_factor);
    EXPECT_TRUE(place);
    fusion.add(*place);
    return run(fusion, 0, 1, 0).track_probability;
  };
  EXPECT_EQ(taken_over(2), 0.5);
  EXPECT_EQ(taken_over(60), 1);
}

}  // namespace
}  // namespace railfix::fusion
