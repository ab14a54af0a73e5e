#include "map/survey.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "core/random.hpp"
#include "unit/track/small_map.hpp"

namespace railfix::tool {
namespace {

using track::LandmarkKind;

/// Runs over edge 1 that see the known balise at 900 m and masts which the map does not have.
struct Passes {
  track::Map map = track::small_map();
  std::vector<double> masts{150, 420, 505, 760};
  std::vector<SurveySighting> sightings;

  Passes(size_t runs, double run_sigma_m, uint64_t seed) {
    map.landmarks.pop_back();  // the mast of the small map
    map.landmarks[0].sigma_m = 0.05;
    core::Random random(seed);
    constexpr double kEach = 0.0707;  // of 0.1 m: half of the variance is the same in every run
    std::vector<double> common;
    for (size_t i = 0; i <= masts.size(); ++i) common.push_back(random.normal(0, kEach));
    for (size_t run = 0; run < runs; ++run) {
      const double shared = random.normal(0, run_sigma_m);
      const auto see = [&](LandmarkKind kind, double at, double lateral, double wrong) {
        const double seen = at + shared + wrong + random.normal(0, kEach);
        sightings.push_back({run, at, kind, 1, seen, lateral, 0.1, run_sigma_m});
      };
      for (size_t i = 0; i < masts.size(); ++i) see(LandmarkKind::mast, masts[i], -3, common[i]);
      see(LandmarkKind::balise, 900, 0, common.back());
    }
  }
};

TEST(Survey, FindsWhatSeveralRunsSawWithHonestSigmas) {
  double squares = 0;
  double count = 0;
  for (uint64_t seed = 1; seed <= 30; ++seed) {
    const Passes passes(5, 0.5, seed);
    const Survey survey = survey_landmarks(passes.map, passes.sightings, {.stretch_m = 2000, .drift = 1e-5});
    ASSERT_EQ(survey.landmarks.size(), 5U);
    for (const SurveyedLandmark& found : survey.landmarks) {
      if (found.known_id != 0) continue;
      double error = 1e9;
      for (const double at : passes.masts) {
        if (std::abs(found.landmark.offset_m - at) < std::abs(error)) error = found.landmark.offset_m - at;
      }
      EXPECT_EQ(found.runs, 5U);
      EXPECT_NEAR(found.landmark.lateral_m, -3, 1e-9);
      // The shared error of each run goes to the balise that is known to 5 cm, not into the masts.
      EXPECT_LT(found.landmark.sigma_m, 0.15);
      squares += std::pow(error / found.landmark.sigma_m, 2);
      ++count;
    }
  }
  EXPECT_NEAR(std::sqrt(squares / count), 1.0, 0.25);
}

// A double track: the other track's masts are seen on the side where the own ones of a third one would be.
TEST(Survey, AMastFurtherAsideIsAnotherOne) {
  Passes passes(3, 0.5, 1);
  const auto own = passes.sightings;
  for (auto seen : own) {
    if (seen.kind != LandmarkKind::mast) continue;
    seen.offset_m += 1;
    seen.way_m += 1;
    seen.lateral_m = -7.2;
    passes.sightings.push_back(seen);
  }
  uint32_t id = 1;
  for (const double m : passes.masts) passes.map.landmarks.push_back({++id, LandmarkKind::mast, 1, m, -3.1, 0.1, ""});
  int known = 0;
  int further = 0;
  for (const auto& found : survey_landmarks(passes.map, passes.sightings, {}).landmarks) {
    if (found.landmark.kind != LandmarkKind::mast) continue;
    EXPECT_EQ(found.sightings, 3U);
    known += found.known_id != 0 ? 1 : 0;
    further += found.known_id == 0 && std::abs(found.landmark.lateral_m + 7.2) < 0.1 ? 1 : 0;
  }
  EXPECT_EQ(known, 4);
  EXPECT_EQ(further, 4);
}

/// Runs whose places the same vague masts of the map have told, by a filter that is honest: all runs err alike.
struct RunsOnAVagueMap {
  static constexpr double kApartM = 400;
  static constexpr double kMapSigmaM = 3;
  static constexpr double kWaySigmaM = 0.4;  // of the odometry, from one mast to the next
  track::Map map;
  std::vector<double> masts;
  std::vector<SurveySighting> sightings;

  RunsOnAVagueMap(size_t runs, uint64_t seed) : random_(seed) {
    map.edges = {{1, "line", 1, 2, "", track::Alignment::chained({0, 0, 0}, {{20000, 0, 0}})}};
    for (uint32_t id = 1; id < 50; ++id) {
      map.landmarks.push_back({id, LandmarkKind::mast, 1, kApartM * id, -3, kMapSigmaM, ""});
      masts.push_back(kApartM * id + random_.normal(0, kMapSigmaM));
    }
    for (size_t run = 0; run < runs; ++run) pass(run);
  }

 private:
  void pass(size_t run) {
    double variance = kMapSigmaM * kMapSigmaM;
    double off_m = random_.normal(0, kMapSigmaM);
    double counted_m = 0;  // too much
    for (size_t i = 0; i < masts.size(); ++i) {
      const double moved_m = random_.normal(0, kWaySigmaM);
      off_m += moved_m;
      counted_m += moved_m;
      variance += kWaySigmaM * kWaySigmaM;
      const double seen_m = masts[i] + off_m + random_.normal(0, 0.07);
      sightings.push_back(
          {run, masts[i] + counted_m, LandmarkKind::mast, 1, seen_m, -3, 0.1, std::sqrt(variance), off_m - counted_m});
      const double gain = variance / (variance + kMapSigmaM * kMapSigmaM);
      off_m += gain * (map.landmarks[i].offset_m - masts[i] - off_m);
      variance *= 1 - gain;
    }
  }
  core::Random random_;
};

TEST(Survey, WhatTheMapHasToldAllRunsCountsOnce) {
  for (const size_t runs : {2U, 10U}) {
    double squares = 0;
    double count = 0;
    for (uint64_t seed = 1; seed <= 8; ++seed) {
      const RunsOnAVagueMap passes(runs, seed);
      for (const SurveyedLandmark& found : survey_landmarks(passes.map, passes.sightings, {}).landmarks) {
        ASSERT_NE(found.known_id, 0U);
        const double error_m = found.landmark.offset_m - passes.masts[found.known_id - 1];
        squares += std::pow(error_m / found.landmark.sigma_m, 2);
        ++count;
      }
    }
    EXPECT_GT(count, 8 * 45);
    const double ratio = std::sqrt(squares / count);
    EXPECT_LT(ratio, 1.1) << runs << " runs";
    EXPECT_GT(ratio, 0.6) << runs << " runs";
  }
}

// Week after week on the map of the week before: what the camera sees wrongly in the same way would count again.
TEST(Survey, AMapThatHasLearntGetsNewLandmarksAlone) {
  const Passes passes(4, 0.5, 3);
  track::Map map = passes.map;
  const auto learn = [&](size_t first_run, size_t masts) {
    std::vector<SurveySighting> week;
    for (const SurveySighting& seen : passes.sightings) {
      const bool sees = seen.kind != LandmarkKind::mast || seen.offset_m < passes.masts[masts - 1] + 10;
      if (sees && seen.run / 2 == first_run / 2) week.push_back(seen);
    }
    apply_survey(survey_landmarks(map, week, {.stretch_m = 2000, .drift = 1e-5}), map);
    map.learnt_runs.push_back(std::to_string(first_run));
  };
  learn(0, 2);
  const auto before = map.landmarks;
  ASSERT_EQ(before.size(), passes.map.landmarks.size() + 2);
  learn(2, 4);
  ASSERT_EQ(map.landmarks.size(), before.size() + 2);
  for (size_t i = 0; i < before.size(); ++i) {
    EXPECT_EQ(map.landmarks[i].offset_m, before[i].offset_m);
    EXPECT_EQ(map.landmarks[i].sigma_m, before[i].sigma_m);
  }
  for (size_t i = 0; i < 2; ++i) {
    const track::Landmark& added = map.landmarks[before.size() + i];
    EXPECT_NEAR(added.offset_m, passes.masts[2 + i], 4 * added.sigma_m);
  }
}

TEST(Survey, TwoBalisesOfAGroupAreTwo) {
  Passes passes(3, 0.3, 7);
  for (size_t run = 0; run < 3; ++run) {
    const double shared = 0.2 * static_cast<double>(run);
    for (const double at : {300.0, 303.0}) {
      if (run == 1 && at == 300) continue;                   // missed there
      const double lateral_m = run % 2 == 0 ? 0.01 : -0.01;  // on neither side
      passes.sightings.push_back({run, at, LandmarkKind::balise, 1, at + shared, lateral_m, 0.07, 0.3});
    }
  }
  std::vector<double> found;
  for (const auto& thing : survey_landmarks(passes.map, passes.sightings, {}).landmarks) {
    if (thing.landmark.kind == LandmarkKind::balise && thing.known_id == 0) found.push_back(thing.landmark.offset_m);
  }
  ASSERT_EQ(found.size(), 2U);
  EXPECT_NEAR(found[1] - found[0], 3, 0.2);
}

// A run against the edge: its place is wrong to the other side, and fixes move it on the way.
TEST(Survey, FixesOfARunAndItsDirectionDoNotMatter) {
  const track::Map map = [] {
    track::Map made = track::small_map();
    made.landmarks.resize(1);
    made.landmarks[0].sigma_m = 0.02;
    return made;
  }();
  std::vector<SurveySighting> sightings;
  for (const size_t run : {0U, 1U}) {
    const bool reverse = run == 1;
    for (const double at : {800.0, 850.0, 900.0}) {
      // A fix at 870 m moved the place by 2 m in running direction, to where it is right but for 0.5 m.
      const bool moved = reverse ? at < 870 : at > 870;
      const double ahead_m = moved ? 2.5 : 0.5;
      const double seen_m = at + (reverse ? -1 : 1) * (ahead_m - 2);
      sightings.push_back({run, reverse ? 1000 - at : at, at == 900 ? LandmarkKind::balise : LandmarkKind::mast, 1,
                           seen_m, at == 900 ? 0.0 : -3.0, 0.05, 3, ahead_m, reverse});
    }
  }
  for (const auto& found : survey_landmarks(map, sightings, {}).landmarks) {
    const double nearest_m = std::round(found.landmark.offset_m / 50) * 50;
    EXPECT_NEAR(found.landmark.offset_m, nearest_m, 0.1) << track::to_string(found.landmark.kind);
    EXPECT_LT(found.landmark.sigma_m, 0.2);
  }
}

TEST(Survey, AnOutlierAndAThingSeenOnceDoNotCount) {
  Passes passes(6, 0.2, 4);
  passes.sightings[1].offset_m += 2.5;  // the mast at 420 in the first run
  passes.sightings.push_back({3, 600, LandmarkKind::bridge, 1, 600, 0, 0.1, 0.2});
  const Survey survey = survey_landmarks(passes.map, passes.sightings, {.stretch_m = 2000, .drift = 1e-5});
  EXPECT_EQ(survey.left_alone, 1U);
  EXPECT_GE(survey.outliers, 1U);
  double nearest = 1e9;
  for (const SurveyedLandmark& found : survey.landmarks)
    nearest = std::min(nearest, std::abs(found.landmark.offset_m - 420));
  EXPECT_LT(nearest, 0.3);
}

TEST(Survey, TheMapGetsTheNewLandmarks) {
  Passes passes(4, 0.3, 2);
  const Survey survey = survey_landmarks(passes.map, passes.sightings, {});
  track::Map map = passes.map;
  apply_survey(survey, map);
  ASSERT_EQ(map.landmarks.size(), passes.map.landmarks.size() + 4);
  for (size_t i = 0; i < map.landmarks.size(); ++i) EXPECT_EQ(map.landmarks[i].id, i + 1);
  EXPECT_EQ(map.landmarks.back().kind, LandmarkKind::mast);
  EXPECT_THAT(survey_landmarks(passes.map, {}, {}).landmarks, testing::IsEmpty());
}

/// The map has a pair of balises at 900 and 903 m; three runs, whose places are better, see it elsewhere.
class ShiftedPair : public testing::TestWithParam<double> {
 protected:
  ShiftedPair() {
    map_.landmarks.resize(1);
    map_.landmarks.push_back({2, LandmarkKind::balise, 1, 903, 0, 0.1, "B2"});
    map_.balise_groups = {{85, 100, 1, 900, true, false, 5, {1, 2}}};
    for (size_t run = 0; run < 3; ++run) {
      for (const double at : {900.0, 903.0})
        sightings_.push_back({run, at, LandmarkKind::balise, 1, at + GetParam(), 0, 0.05, 0.05});
    }
  }
  track::Map map_ = track::small_map();
  std::vector<SurveySighting> sightings_;
};

TEST_P(ShiftedPair, IsMovedAsAPairAndItsGroupWithIt) {
  const Survey survey = survey_landmarks(map_, sightings_, {.stretch_m = 2000});
  ASSERT_EQ(survey.landmarks.size(), 2U);
  for (const auto& found : survey.landmarks) EXPECT_EQ(found.sightings, 3U) << found.known_id;
  apply_survey(survey, map_);
  EXPECT_NEAR(map_.landmarks[1].offset_m - map_.landmarks[0].offset_m, 3, 0.1);
  EXPECT_NEAR(map_.landmarks[0].offset_m, 900 + GetParam(), 0.5 * std::abs(GetParam()));
  const auto& group = map_.balise_groups[0];
  EXPECT_DOUBLE_EQ(group.offset_m, map_.landmarks[0].offset_m);
  // Beyond 3 sigmas it has moved, and its sigma holds both places.
  const double sigma_m = std::abs(GetParam()) > 1 ? std::abs(GetParam()) / 3 : 0.1;
  EXPECT_NEAR(group.q_locacc_m, std::max(1.0, std::ceil(4 * sigma_m)), 0.1);
}

INSTANTIATE_TEST_SUITE_P(By, ShiftedPair, testing::Values(-2.5, -1.2, 0.5, 1.2, 2.5));

}  // namespace
}  // namespace railfix::tool
