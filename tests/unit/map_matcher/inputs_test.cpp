#include "map_matcher/inputs.hpp"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <functional>
#include <limits>
#include <memory>
#include <vector>

#include "map_matcher/landmark_matcher.hpp"
#include "map_matcher/shape/curvature_matcher.hpp"
#include "map_matcher/track_choice/gyro_turn.hpp"
#include "map_matcher/track_choice/track_chooser.hpp"
#include "unit/map_matcher/fork_map.hpp"

namespace railfix::map_matcher {
namespace {

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
constexpr double kInf = std::numeric_limits<double>::infinity();
constexpr std::array kNone = {kNan, kInf, -kInf, 1e300};

template <typename Input>
using Fields = std::vector<double Input::*>;

/// Of a good input, none of these fields may be such a number.
template <typename Input>
void expect_refused(const Input& good, const Fields<Input>& fields) {
  EXPECT_TRUE(has_sense(good));
  for (size_t i = 0; i < fields.size(); ++i) {
    for (const double none : kNone) {
      Input bad = good;
      bad.*fields[i] = none;
      EXPECT_FALSE(has_sense(bad)) << "field " << i << ": " << none;
    }
  }
}

const Sighting kSighting{1, track::LandmarkKind::frog, 30, 0.7, 0.2, 0.95};
const Fields<Sighting> kOfSighting = {&Sighting::distance_ahead_m, &Sighting::lateral_m, &Sighting::sigma_m,
                                      &Sighting::confidence};
const StepInput kStep{2, 1, true, 0.5, 0.001, 1e-4, 100, 25};
const Fields<StepInput> kOfStep = {&StepInput::step_m, &StepInput::yaw_rad, &StepInput::yaw_sigma_rad,
                                   &StepInput::distance_m, &StepInput::speed_mps};
const Turn kTurn{1, 0.001, 1e-4, 1e-4};
const Fields<Turn> kOfTurn = {&Turn::way_m, &Turn::turn_rad, &Turn::sigma_rad, &Turn::bias_rad};

TEST(Inputs, NoFieldMayBeWhatIsNoNumber) {
  expect_refused(kSighting, kOfSighting);
  expect_refused(kStep, kOfStep);
  expect_refused(kTurn, kOfTurn);
  expect_refused(ViewInput{0.001, 1e-8}, {&ViewInput::curvature_per_m, &ViewInput::variance});
  expect_refused(GyroInput{0.01}, {&GyroInput::rate_rps});
  expect_refused(GnssInput{2.6e6, 1.2e6, 1}, {&GnssInput::easting_m, &GnssInput::northing_m, &GnssInput::hdop});
}

TEST(Inputs, NoFieldOfAStateMayBeWhatIsNoNumber) {
  const StateInput good{{1, {1, 100, track::Direction::forward}, 20, 500, 3, 3}, 1, 1, 1, {1000, 2000, 0}};
  using Field = std::function<double&(StateInput&)>;
  const std::vector<Field> fields = {[](auto& s) -> double& { return s.placed.place.offset_m; },
                                     [](auto& s) -> double& { return s.placed.distance_m; },
                                     [](auto& s) -> double& { return s.track_probability; },
                                     [](auto& s) -> double& { return s.visual_scale; },
                                     [](auto& s) -> double& { return s.pose.easting_m; },
                                     [](auto& s) -> double& { return s.pose.northing_m; }};
  EXPECT_TRUE(has_sense(good));
  for (size_t i = 0; i < fields.size(); ++i) {
    for (const double none : kNone) {
      StateInput bad = good;
      fields[i](bad) = none;
      EXPECT_FALSE(has_sense(bad)) << "field " << i << ": " << none;
    }
  }
  const std::vector<Field> lengths = {[](auto& s) -> double& { return s.placed.over_m; },
                                      [](auto& s) -> double& { return s.placed.under_m; },
                                      [](auto& s) -> double& { return s.sigma_m; }};
  for (const auto& length : lengths) {
    StateInput state = good;
    for (const double none : {kNan, -1.0}) {
      length(state) = none;
      EXPECT_FALSE(has_sense(state));
    }
    length(state) = kInf;
    EXPECT_TRUE(has_sense(state)) << "the place may be anywhere";
  }
  StateInput state = good;
  state.placed.speed_mps = kNan;
  EXPECT_TRUE(has_sense(state)) << "the speed may not be known";
  state.placed.speed_mps = kInf;
  EXPECT_FALSE(has_sense(state));
}

TEST(Inputs, WhatDividesIsNotZeroAndProbabilitiesAreSuch) {
  for (const double sigma_m : {0.0, -0.1}) {
    Sighting sighting = kSighting;
    sighting.sigma_m = sigma_m;
    EXPECT_FALSE(has_sense(sighting));
    EXPECT_FALSE(has_sense(ViewInput{0.001, sigma_m}));
  }
  for (const double confidence : {-0.01, 1.01}) {
    Sighting sighting = kSighting;
    sighting.confidence = confidence;
    EXPECT_FALSE(has_sense(sighting));
  }
  StepInput step = kStep;
  step.reference_stamp_ns = step.stamp_ns;
  EXPECT_FALSE(has_sense(step)) << "no time between its pictures";
  step.measured = false;
  step.step_m = kNan;
  EXPECT_TRUE(has_sense(step)) << "says nothing but that it was not measured";
}

TEST(Inputs, TheTrackIsChosenWhateverOneInputWas) {
  const auto map = fork();
  const auto sight = [](TrackChooser& chooser, double Sighting::*field, double none) {
    Sighting bad{0, track::LandmarkKind::frog, 50, 0.72, 0.2, 0.95};
    bad.*field = none;
    chooser.sight(bad);
  };
  for (const double none : kNone) {
    TrackChooser chooser({}, map, std::make_shared<const track::Ways>(*map));
    for (double m = 400; m < 900; m += 1) {
      const bool behind = m > 500;
      chooser.follow({{behind ? 3U : 1U, behind ? m - 500 : m, track::Direction::forward}, 3, 3, 0.5});
      if (m == 480) {
        for (const auto field : kOfSighting) sight(chooser, field, none);
        chooser.see(none, 1e-4);
        chooser.see(0, none);
        for (const auto field : kOfTurn) {
          Turn bad = kTurn;
          bad.*field = none;
          chooser.move(bad);
          chooser.stand(bad);
        }
        chooser.move_blind(none);
      }
      chooser.move({1, m >= 500 && m < 540 ? 0.003 : 0.0, 1e-4});
    }
    const auto choice = chooser.choice();
    ASSERT_TRUE(choice);
    EXPECT_TRUE(choice->known) << none;
    EXPECT_EQ(choice->options.front().place.edge, 3U) << none;
  }
}

TEST(Inputs, TheWayGoesOnWhateverOneStepWas) {
  for (const auto field : kOfStep) {
    for (const double none : {kNan, kInf}) {
      StepChain chain;
      for (int i = 1; i <= 100; ++i) {
        StepInput step{i * 20'000'000LL, (i - 1) * 20'000'000LL, true, 0.5, 0.001, 1e-4, 0.5 * i, 25};
        if (i == 50) step.*field = none;
        chain.add(step);
      }
      EXPECT_NEAR(chain.odometer_m(), 49.5, 1.1);
      ASSERT_TRUE(chain.turn());
      EXPECT_NEAR(chain.turn()->turn_rad, 0.001, 1e-9);
    }
  }
}

TEST(Inputs, FixesGoOnWhateverOneCurvatureOrSightingWas) {
  auto map = std::make_shared<track::Map>();
  map->edges.push_back(
      {1, "line", 1, 2, "",
       track::Alignment::chained({0, 0, 0}, {{300, 0, 0}, {80, 0, 0.00125}, {620, 0.00125, 0.00125}})});
  map->landmarks = {{1, track::LandmarkKind::balise, 1, 500, 0, 0.1, ""}};
  const auto path = std::make_shared<const track::Path>(
      core::value_or_throw(track::Path::follow(map, {1, 0, track::Direction::forward}, 900, 0)));
  for (const double none : kNone) {
    CurvatureMatcher shape({}, path);
    LandmarkMatcher landmarks({}, path);
    int fixes = 0;
    for (double m = 100; m < 500; m += 1) {
      if (m == 200) {
        shape.add(none, 0, 1e-4, CurvatureOf::body);
        shape.add(m, none, 1e-4, CurvatureOf::body);
        shape.add(m, 0, none, CurvatureOf::body);
      }
      shape.add(m, path->curvature_at(m), 1e-4, CurvatureOf::rails);
      if (shape.match(1, m, Prior{m, 20, 20, m})) ++fixes;
    }
    EXPECT_GT(fixes, 0) << none;
    Sighting balise{1, track::LandmarkKind::balise, 10, 0, 0.1, 0.95};
    for (const auto field : kOfSighting) {
      Sighting bad = balise;
      bad.*field = none;
      EXPECT_FALSE(landmarks.add(bad, Prior{490, 5, 5, 490}));
    }
    EXPECT_TRUE(landmarks.add(balise, Prior{490, 5, 5, 490})) << none;
  }
}

TEST(Inputs, TheGyroGoesOnWhateverOneSampleWas) {
  for (const double none : kNone) {
    GyroTurn gyro({});
    for (int i = 0; i < 200; ++i) gyro.add(i * 20'000'000LL, i == 100 ? none : 0.01 + 1e-9 * i);
    const auto turn = gyro.between(120 * 20'000'000LL, 170 * 20'000'000LL);
    ASSERT_TRUE(turn);
    EXPECT_NEAR(turn->turn_rad, 0.01, 1e-6) << none;
  }
}

// Sightings among too many of their kind are not lost for when the window is smaller, nor for those of a rarer kind.
TEST(Inputs, AWindowWithTooManyOfAKindIsNotSearchedButRemembered) {
  auto map = std::make_shared<track::Map>();
  map->edges.push_back({1, "line", 1, 2, "", track::Alignment::chained({0, 0, 0}, {{9000, 0, 0}})});
  const auto put = [&](track::LandmarkKind kind, double at_m, double lateral_m) {
    const auto id = static_cast<uint32_t>(map->landmarks.size() + 1);
    map->landmarks.push_back({id, kind, 1, at_m, lateral_m, 0.1, ""});
  };
  for (int i = 0; i < 200; ++i) put(track::LandmarkKind::mast, 1000 + 34.0 * i + (i * i * 11) % 29, 3.3);
  put(track::LandmarkKind::balise, 4333, 0);
  const auto path = std::make_shared<const track::Path>(
      core::value_or_throw(track::Path::follow(map, {1, 0, track::Direction::forward}, 8900, 0)));
  LandmarkMatcher landmarks({}, path);
  const auto sight = [&](track::LandmarkKind kind, double at_m, double half_m) {
    const double lateral_m = kind == track::LandmarkKind::mast ? 3.3 : 0;
    return landmarks.add({1, kind, 8, lateral_m, 0.1, 0.95}, Prior{at_m - 8, half_m, half_m, at_m - 8});
  };
  for (size_t i = 90; i < 94; ++i)
    EXPECT_FALSE(sight(track::LandmarkKind::mast, map->landmarks[i].offset_m, 4000)) << "in so wide a window";
  LandmarkMatcher with_masts = landmarks;
  const auto balise = landmarks.add({1, track::LandmarkKind::balise, 8, 0, 0.1, 0.95}, Prior{4325, 4000, 4000, 4325});
  ASSERT_TRUE(balise);
  EXPECT_EQ(balise->landmark, 201U);
  const auto mast = with_masts.add({1, track::LandmarkKind::mast, 8, 3.3, 0.1, 0.95},
                                   Prior{map->landmarks[94].offset_m - 8, 700, 700, map->landmarks[94].offset_m - 8});
  ASSERT_TRUE(mast);
  EXPECT_EQ(mast->landmark, 95U);
}

// To and fro on the same stretch, the readings off the marks by a little more every time.
TEST(Inputs, ShuntingOnTheSpotDoesNotCostMoreAndMore) {
  auto map = std::make_shared<track::Map>();
  map->edges.push_back({1, "line", 1, 2, "", track::Alignment::chained({0, 0, 0}, {{2000, 0, 0}})});
  const auto path = std::make_shared<const track::Path>(
      core::value_or_throw(track::Path::follow(map, {1, 0, track::Direction::forward}, 1900, 0)));
  CurvatureMatcher shape({}, path);
  for (int i = 0; i < 100'000; ++i) {
    shape.add(500 + 190 * std::sin(0.001 * i), 0, 1e-4, i % 2 == 0 ? CurvatureOf::body : CurvatureOf::rails);
  }
  EXPECT_LE(shape.bins(), 202U);
}

}  // namespace
}  // namespace railfix::map_matcher
