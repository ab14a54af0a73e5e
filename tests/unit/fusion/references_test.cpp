// What landmarks and the search on the map say of the place, and how far one of them is believed.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "straight_run.hpp"

namespace railfix::fusion {
namespace {

using testing::HasSubstr;
using testing::Not;

/// Known, and sighted, to a metre.
FixInput mast_at(double t_s, double offset_m, uint32_t landmark) {
  auto fix = fix_at(t_s, offset_m, landmark);
  fix.sigma_m = 1;
  return fix;
}

TEST(References, NetworkFixStartsThePosition) {
  auto fusion = fusion_without_start();
  run(fusion, 0, 10, 20);
  FixInput fix = fix_at(10, 4000, 0, 0.99);
  fix.kind = FixKind::network;
  fix.sigma_m = 3;
  fix.direction = track::Direction::reverse;
  fusion.add(fix);
  const auto state = run(fusion, 10, 11, 20);
  EXPECT_TRUE(state.track_known);
  EXPECT_NEAR(state.position.offset_m, 3980, 0.1);
  EXPECT_EQ(state.position.direction, track::Direction::reverse);
  EXPECT_NEAR(state.distance_m, 220, 0.1);
  EXPECT_GT(state.over_m, 4 * 3);
  EXPECT_LT(state.over_m, 20);
}

// Its gate is wide as long as the place is vague. The line runs to the north.
TEST(References, AnOutlierOfGnssBehindAVaguePlaceIsHeld) {
  auto fusion = fusion_without_start();
  for (int k = 0; k < 10; ++k) {
    run(fusion, k, k + 1, 20);
    fusion.add(GnssInput{at(k + 1.001), 0, 20.0 * (k + 1), 1.0, 1});
  }
  FixInput fix = fix_at(10.01, 200, 0, 0.99);
  fix.kind = FixKind::network;
  fix.sigma_m = 17;
  fusion.add(fix);
  run(fusion, 10.02, 11, 20);
  fusion.add(GnssInput{at(11.001), 0, 220 + 60, 1.0, 1});
  const auto state = run(fusion, 11, 11.5, 20);
  EXPECT_NEAR(state.position.offset_m, 290, 5);
  EXPECT_GT(state.over_m, state.position.offset_m - 230);
}

// The map has it a metre off, and so has every sighting of it.
TEST(References, ALandmarkThatIsSightedAThousandTimesIsNoSurerThanOnce) {
  const auto sigma_after = [](int sightings) {
    auto fusion = fusion_at(0);
    auto state = run(fusion, 0, 20, 20);
    for (int i = 1; i <= sightings; ++i) {
      fusion.add(mast_at(20 + 0.1 * i, 401, 7));
      state = run(fusion, 20 + 0.1 * i, 20.1 + 0.1 * i, 0);
    }
    EXPECT_LT(state.position.offset_m - 400, state.over_m);
    return state.sigma_m;
  };
  const double once_m = sigma_after(1);
  EXPECT_LT(once_m, 1);
  EXPECT_NEAR(sigma_after(1000), once_m, 0.1 * once_m);
}

// As a shunter does: A, B, A, B, ...
TEST(References, TwoLandmarksThatAreMetInTurnAreNoSurerThanOnce) {
  auto fusion = fusion_at(0);
  double t_s = 0;
  const auto go = [&](double time_s, double speed_mps) {
    t_s += time_s;
    return run(fusion, t_s - time_s, t_s, speed_mps);
  };
  go(20, 20);
  fusion.add(mast_at(t_s, 400.8, 7));
  go(3, 20);
  fusion.add(mast_at(t_s, 460.8, 8));
  const double once_m = go(1, 20).sigma_m;
  TrainEstimate state;
  for (int i = 0; i < 20; ++i) {
    go(1, -20);
    fusion.add(mast_at(t_s, 460.8, 8));
    go(3, -20);
    fusion.add(mast_at(t_s, 400.8, 7));
    state = go(4, 20);
  }
  EXPECT_GT(state.sigma_m, 0.9 * once_m);
  EXPECT_LT(state.position.offset_m - 480, state.over_m);
}

TEST(References, LandmarkIsIgnoredWhilePlaceIsUnknown) {
  auto fusion = fusion_without_start();
  run(fusion, 0, 1, 20);
  fusion.add(fix_at(1, 4000, 7));
  EXPECT_FALSE(run(fusion, 1, 2, 20).track_known);
}

TEST(References, TwoLandmarksCalibrateTheCamerasScale) {
  auto fusion = fusion_at(0);
  double place_m = 0;
  for (int k = 1; k <= 5; ++k) {
    run(fusion, (k - 1) * 20.0, k * 20.0, 20);  // the camera says 400 m, truly it is 1 % more
    place_m = k * 404.0;
    fusion.add(sure_fix_at(k * 20.0, place_m, static_cast<uint32_t>(k)));
  }
  const auto state = run(fusion, 100, 120, 20);
  EXPECT_NEAR(state.visual_scale, 1.01, 0.001);
  EXPECT_NEAR(state.position.offset_m, place_m + 404, 0.8);
  EXPECT_EQ(state.reference, 5U);
  EXPECT_NEAR(state.since_reference_m, 404, 1.0);
  EXPECT_EQ(state.integrity, Integrity::ok) << state.reason;
}

// The interval is as wide as the budget at its begin already: counted from there it would be exceeded.
TEST(References, ACurveThatTellsThePlaceVaguelyIsNoReference) {
  for (const double sigma_m : {0.5, 3.0}) {
    auto fusion = fusion_at(0);
    run(fusion, 0, 10, 20);
    fusion.add(fix_at(10, 200, 1));
    run(fusion, 10, 40, 20);
    FixInput curve = fix_at(40, 800, 0);
    curve.kind = FixKind::curvature;
    curve.sigma_m = sigma_m;
    fusion.add(curve);
    const auto state = run(fusion, 40, 41, 20);
    EXPECT_NEAR(state.since_reference_m, sigma_m < 1 ? 20 : 620, 1.0) << sigma_m;
    EXPECT_EQ(state.reference, sigma_m < 1 ? 0U : 1U) << sigma_m;
    EXPECT_THAT(state.reason, Not(HasSubstr("wider"))) << sigma_m;
  }
}

TEST(References, OneFalseFixNeverMovesTheTrain) {
  auto fusion = fusion_at(0);
  run(fusion, 0, 10, 20);
  fusion.add(fix_at(10, 260, 3));
  const auto state = run(fusion, 10, 11, 20);
  EXPECT_NEAR(state.position.offset_m, 220, 0.1);
  EXPECT_THAT(state.reason, HasSubstr("a position fix was refused"));
  EXPECT_GT(state.under_m, 60);  // but the interval admits that it may be right
  EXPECT_LT(state.over_m, 20);
}

TEST(References, TwoFixesThatAgreeMoveTheTrain) {
  auto fusion = fusion_at(0);
  run(fusion, 0, 10, 20);
  fusion.add(fix_at(10, 260, 3));
  run(fusion, 10, 15, 20);
  fusion.add(fix_at(15, 360, 4));
  const auto state = run(fusion, 15, 16, 20);
  EXPECT_NEAR(state.position.offset_m, 380, 1);
  EXPECT_EQ(state.integrity, Integrity::degraded);
}

// A false fix inside the interval is found out by the next one, and the interval held the truth meanwhile.
TEST(References, FalseFixInsideTheIntervalIsUndoneByTheNext) {
  auto fusion = fusion_at(0);
  run(fusion, 0, 20, 20);
  fusion.add(fix_at(20, 410, 3, 0.99));
  const auto misled = run(fusion, 20, 30, 20);
  EXPECT_GT(misled.position.offset_m, 605);
  EXPECT_GT(misled.over_m, misled.position.offset_m - 600);
  fusion.add(fix_at(30, 600, 4, 0.99));
  const auto state = run(fusion, 30, 31, 20);
  EXPECT_NEAR(state.position.offset_m, 620, 0.5);
  EXPECT_EQ(state.reference, 4U);
}

TEST(References, ImprobableAndForeignFixesAreLeftOut) {
  auto fusion = fusion_at(0);
  run(fusion, 0, 10, 20);
  fusion.add(fix_at(10, 203, 3, 0.5));
  FixInput foreign = fix_at(10.01, 100, 4);
  foreign.edge = 77;
  fusion.add(foreign);
  const auto state = run(fusion, 10, 11, 20);
  EXPECT_NEAR(state.position.offset_m, 220, 0.1);
  EXPECT_EQ(state.reference, 0U);
  EXPECT_THAT(state.reason, HasSubstr("another track"));
}

// However sure and sharp: a portal may be sighted metres off.
TEST(References, AWrongSightingCostsAccuracyUntilTheNextOnesAndTheIntervalHolds) {
  for (const double scale : {0.995, 1.0, 1.008}) {
    for (const double wrong_m : {-3.0, -1.0, 1.0, 2.0, 3.0}) {
      Passage passage({.camera = scale});
      passage.run_to(600);
      passage.sight(0);
      passage.run_to(1100);
      passage.sight(wrong_m);
      passage.run_to(2600);
      EXPECT_GT(std::abs(passage.error_m()), 0.5 * std::abs(wrong_m));  // it was believed
      passage.sight(0.1);
      passage.run_to(3200);
      passage.sight(-0.1);
      passage.run_to(4200);
      EXPECT_LT(std::abs(passage.error_m()), 0.5) << scale << " " << wrong_m;
      EXPECT_LT(std::abs(passage.scale_error()), 4e-4) << scale << " " << wrong_m;
    }
  }
}

// The same landmark, wrong in the same way, has nothing new to say.
TEST(References, AWrongSightingIsNotConfirmedByAnotherOfTheSameLandmark) {
  Passage passage({.camera = 1.003});
  passage.run_to(600);
  passage.sight(0);
  passage.run_to(1100);
  passage.sight(2);
  for (const double place_m : {1106.0, 1112.0, 1118.0}) {
    passage.run_to(place_m);
    passage.sight_again(2);
  }
  passage.run_to(2600);
  passage.sight(0);
  passage.run_to(3200);
}

// A place that six landmarks have confirmed, and camera and wheel, which agree, counted on from there.
void run_over_right_ones(Passage& passage) {
  for (int i = 1; i <= 6; ++i) {
    passage.run_to(400.0 * i);
    passage.sight(i % 2 == 0 ? 0.05 : -0.05);
  }
}

// A mount that was knocked, signs that were moved: the odometers cannot have run so far ahead, so the interval holds
// their place too.
TEST(References, LandmarksInARowThatAreWrongAlikeAreHeld) {
  for (const double wrong_m : {-3.0, 2.0, 3.0, 12.0}) {
    Passage passage({.camera = 1.003, .wheel = 0.998});
    run_over_right_ones(passage);
    for (const double place_m : {2500.0, 2550.0, 2600.0, 2640.0, 2700.0, 2750.0}) {
      passage.run_to(place_m);
      passage.sight(wrong_m);
    }
    passage.run_to(2950);
    EXPECT_GT(std::abs(passage.error_m()), 0.5 * std::abs(wrong_m));  // they were believed
    for (const double place_m : {3000.0, 3050.0, 3100.0, 3150.0}) {
      passage.run_to(place_m);
      passage.sight(0.05);
    }
    EXPECT_LT(std::abs(passage.error_m()), 0.5) << wrong_m;
  }
}

// However improbable it is that the odometers strayed: so many landmarks are right.
TEST(References, ManyLandmarksSettleThatTheTrainIsElsewhere) {
  auto fusion = fusion_at(0);
  double t_s = 0;
  uint32_t landmark = 0;
  const auto width_behind = [&](int landmarks, double off_m, double apart_s) {
    for (int i = 0; i < landmarks; ++i) {
      run(fusion, t_s, t_s + apart_s, 20);
      t_s += apart_s;
      fusion.add(fix_at(t_s, 20 * t_s + off_m, ++landmark));
    }
    const auto state = run(fusion, t_s, t_s + 0.2, 20);
    t_s += 0.2;
    return state.over_m + state.under_m;
  };
  EXPECT_LT(width_behind(6, 0, 2.5), 4);
  EXPECT_GT(width_behind(6, 6, 2.5), 6);
  EXPECT_LT(width_behind(7, 6, 2.5), 4);
}

TEST(References, EverySecondSightingMayBeWrong) {
  Passage passage({.camera = 1.003});
  double place_m = 0;
  for (const double wrong_m : {0.05, 2.26, 0.1, -0.05, 0.1, -1.5, 0.05, 3.0, -0.1}) {
    passage.run_to(place_m += 700);
    passage.sight(wrong_m);
  }
  passage.run_to(place_m + 1500);
  EXPECT_LT(std::abs(passage.error_m()), 1.0);
}

}  // namespace
}  // namespace railfix::fusion
