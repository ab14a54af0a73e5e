// Landmarks that are no longer where the map has them.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "core/random.hpp"
#include "map/survey.hpp"

namespace railfix::tool {
namespace {

using track::LandmarkKind;

/// Frogs every 200 m of a straight, known to 0.05 m, and one mast at 400 m, known to 0.1 m.
struct PassesOfAMovedMast {
  static constexpr double kMastM = 400;
  track::Map map;
  std::vector<SurveySighting> sightings;
  uint32_t mast_id = 6;

  PassesOfAMovedMast(size_t runs, double moved_m, uint64_t seed, size_t from_run = 0) {
    map.edges = {{1, "line", 1, 2, "", track::Alignment::chained({0, 0, 0}, {{1000, 0, 0}})}};
    for (uint32_t id = 1; id < mast_id; ++id)
      map.landmarks.push_back({id, LandmarkKind::frog, 1, 200.0 * id - 100, 0, 0.05, ""});
    map.landmarks.push_back({mast_id, LandmarkKind::mast, 1, kMastM, -3, 0.1, ""});
    core::Random random(seed);
    for (size_t run = 0; run < runs; ++run) {
      const auto see = [&](LandmarkKind kind, double at_m, double lateral_m, double sigma_m) {
        sightings.push_back({run, at_m, kind, 1, at_m + random.normal(0, 0.05), lateral_m, sigma_m, 0.4});
      };
      for (size_t i = 0; i + 1 < mast_id; ++i) see(LandmarkKind::frog, map.landmarks[i].offset_m, 0, 0.07);
      see(LandmarkKind::mast, kMastM + (run >= from_run ? moved_m : 0), -3, 0.1);
    }
  }
  [[nodiscard]] SurveyedLandmark learnt(uint32_t id) const {
    for (const auto& found : survey_landmarks(map, sightings, {}).landmarks) {
      if (found.known_id == id) return found;
    }
    ADD_FAILURE() << "no run is said to see landmark " << id;
    return {};
  }
};

TEST(SurveyApart, AMovedLandmarkIsToldTakenAndStillHoldsTheOldPlace) {
  for (const double moved_m : {1.0, -3.0}) {
    for (const size_t runs : {2U, 5U, 20U}) {
      const SurveyedLandmark mast = PassesOfAMovedMast(runs, moved_m, 5).learnt(6);
      EXPECT_EQ(mast.runs_apart, runs);
      EXPECT_NEAR(mast.apart_m, moved_m, 0.2);
      EXPECT_NEAR(mast.landmark.offset_m, 400 + moved_m, 0.2);
      EXPECT_GE(mast.landmark.sigma_m * 3, std::abs(mast.landmark.offset_m - 400) - 1e-9);
      EXPECT_LT(mast.landmark.sigma_m, 0.5 * std::abs(moved_m));
    }
  }
}

TEST(SurveyApart, AMovedLandmarkDoesNotTouchTheOthers) {
  const PassesOfAMovedMast passes(3, 3, 8);
  for (uint32_t id = 1; id <= 5; ++id) {
    const SurveyedLandmark frog = passes.learnt(id);
    EXPECT_EQ(frog.runs_apart, 0U);
    EXPECT_LE(frog.landmark.sigma_m, 0.05);
    EXPECT_NEAR(frog.moved_m, 0, 0.05);
  }
  EXPECT_EQ(survey_landmarks(passes.map, passes.sightings, {}).outliers, 0U);
}

TEST(SurveyApart, OneWhereItWasStaysAsItWas) {
  size_t apart = 0;
  for (uint64_t seed = 1; seed <= 20; ++seed) {
    const SurveyedLandmark mast = PassesOfAMovedMast(3, 0, seed).learnt(6);
    apart += mast.runs_apart;
    EXPECT_LE(mast.landmark.sigma_m, 0.1);
    EXPECT_NEAR(mast.landmark.offset_m, 400, 0.2);
  }
  EXPECT_EQ(apart, 0U);
}

TEST(SurveyApart, OneRunAloneMovesNothing) {
  const SurveyedLandmark mast = PassesOfAMovedMast(1, 2, 3).learnt(6);
  EXPECT_EQ(mast.runs_apart, 1U);
  EXPECT_NEAR(mast.apart_m, 2, 0.3);
  EXPECT_DOUBLE_EQ(mast.landmark.offset_m, 400);
  EXPECT_DOUBLE_EQ(mast.landmark.sigma_m, 0.1);
}

TEST(SurveyApart, AMapThatHasLearntIsToldAndCorrectedToo) {
  PassesOfAMovedMast passes(3, 3, 8);
  passes.map.learnt_runs = {"some run"};
  const Survey survey = survey_landmarks(passes.map, passes.sightings, {});
  track::Map map = passes.map;
  apply_survey(survey, map);
  EXPECT_NEAR(map.landmarks[5].offset_m, 403, 0.2);
  EXPECT_NEAR(map.landmarks[5].sigma_m, 1, 0.1);
  for (size_t i = 0; i < 5; ++i) EXPECT_DOUBLE_EQ(map.landmarks[i].offset_m, passes.map.landmarks[i].offset_m);
}

TEST(SurveyApart, WhatRunsPassedAndDidNotSeeIsTold) {
  PassesOfAMovedMast passes(3, 6, 2);  // beyond the gate: one of its own
  passes.map.landmarks.push_back({7, LandmarkKind::mast, 1, 950, -3, 0.1, ""});
  passes.map.landmarks.push_back({8, LandmarkKind::bridge, 1, 500, 0, 0.1, ""});
  const Survey survey = survey_landmarks(passes.map, passes.sightings, {});
  const auto unseen_by = [&](size_t runs) {
    std::vector<PassedTrack> passed;
    for (size_t run = 0; run < runs; ++run) passed.push_back({run, 1, 30, 900});
    return unseen_landmarks(passes.map, survey, passes.sightings, passed, 2);
  };
  const auto unseen = unseen_by(3);
  ASSERT_EQ(unseen.size(), 1U) << "the mast at 950 m was not passed, and no camera here tells bridges";
  EXPECT_EQ(unseen[0].known->id, 6U);
  EXPECT_EQ(unseen[0].runs, 3U);
  EXPECT_TRUE(unseen_by(1).empty());
}

// As maps of OpenStreetMap have it: 0 = not known.
TEST(SurveyApart, ASideThatTheMapDoesNotKnowIsLearnt) {
  PassesOfAMovedMast passes(2, 0, 4);
  passes.map.landmarks[5].lateral_m = 0;
  EXPECT_NEAR(passes.learnt(6).landmark.lateral_m, -3, 1e-9);
  EXPECT_EQ(passes.learnt(1).landmark.lateral_m, 0) << "a frog has none";
  auto& mast = passes.map.landmarks[5];
  mast.lateral_m = -4.9;
  mast.sigma_m = 3;
  EXPECT_NEAR(passes.learnt(6).landmark.lateral_m, -3, 1e-9) << "it was drawn";
  mast.lateral_m = 0;
  mast.sigma_m = 0.1;
  for (auto& seen : passes.sightings) seen.lateral_m = 0;
  EXPECT_EQ(passes.learnt(6).landmark.lateral_m, 0);
}

// Two things in one, or a camera that errs there: its own matter.
TEST(SurveyApart, AThingWhoseSightingsAreAtOddsMakesNoOtherVaguer) {
  PassesOfAMovedMast passes(4, 0, 6);
  passes.map.landmarks.pop_back();
  const auto new_mast = [&] {
    for (const auto& found : survey_landmarks(passes.map, passes.sightings, {}).landmarks) {
      if (found.known_id == 0 && std::abs(found.landmark.offset_m - 400) < 2) return found.landmark.sigma_m;
    }
    return 0.0;
  };
  const double alone_m = new_mast();
  for (size_t run = 0; run < 4; ++run) {
    const double at_m = run % 2 == 0 ? 600 : 602;
    passes.sightings.push_back({run, at_m, LandmarkKind::mast, 1, at_m, -3, 0.1, 0.4});
  }
  EXPECT_NEAR(new_mast(), alone_m, 0.01);
}

// Runs whose wheels or camera count 0.4 % too much, put right at every frog: no frog has moved, at the ends neither.
TEST(SurveyApart, AScaleOfTheRunsMovesNothing) {
  PassesOfAMovedMast line(0, 0, 1);
  line.map.edges = {{1, "line", 1, 2, "", track::Alignment::chained({0, 0, 0}, {{8000, 0, 0}})}};
  line.map.landmarks.clear();
  core::Random random(9);
  for (uint32_t id = 1; id <= 15; ++id)
    line.map.landmarks.push_back({id, LandmarkKind::frog, 1, 500.0 * id, 0, 0.05, ""});
  for (size_t run = 0; run < 3; ++run) {
    for (const auto& frog : line.map.landmarks) {
      const double at_m = frog.offset_m;
      const double place_m = at_m + 0.004 * 490;
      line.sightings.push_back({run, 1.004 * at_m, LandmarkKind::frog, 1, place_m + random.normal(0, 0.05), 0, 0.07,
                                0.75, place_m - 1.004 * at_m});
    }
  }
  const Survey survey = survey_landmarks(line.map, line.sightings, {});
  ASSERT_EQ(survey.landmarks.size(), 15U);
  for (const auto& found : survey.landmarks) {
    EXPECT_EQ(found.runs_apart, 0U) << found.landmark.offset_m;
    EXPECT_NEAR(found.moved_m, 0, 0.1);
    EXPECT_LE(found.landmark.sigma_m, 0.05);
  }
}

// A run that is placed anew has a way of its own: nothing joins it to the one before.
TEST(SurveyApart, StretchesOfARunAreNotJoined) {
  PassesOfAMovedMast passes(2, 0, 7);
  for (auto& seen : passes.sightings) {
    if (seen.offset_m < 450) continue;
    seen.stretch = 1;
    seen.way_m -= 300;  // as if speeds were missing
    seen.place_ahead_m += 300;
  }
  const Survey survey = survey_landmarks(passes.map, passes.sightings, {});
  ASSERT_EQ(survey.landmarks.size(), 6U);
  for (const auto& found : survey.landmarks) {
    EXPECT_NE(found.known_id, 0U) << found.landmark.offset_m;
    EXPECT_NEAR(found.moved_m, 0, 0.1) << found.known_id;
    EXPECT_EQ(found.runs_apart, 0U) << found.known_id;
  }
}

}  // namespace
}  // namespace railfix::tool
