// A start that was told kilometres wrong: the place is no position as soon as something speaks against it, is given up
// when nothing speaks for it, and the train is found where it is.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "fusion/handover.hpp"
#include "straight_run.hpp"
#include "support/train/verdict.hpp"

namespace railfix::fusion::wrong_start_test {
namespace {

using testing::HasSubstr;
using testing::Not;

constexpr double kSpeedMps = 20;

/// A train whose start was told to be at 900 m.
class WrongStart : public testing::Test {
 protected:
  /// Every second `each` says what is measured beside the camera.
  template <typename Each>
  TrainEstimate go(double metres, const Each& each) {
    TrainEstimate state;
    for (double end_s = t_s_ + metres / kSpeedMps; t_s_ < end_s - 1e-9; t_s_ += 1) {
      each();
      state = run(fusion_, t_s_, t_s_ + 1, kSpeedMps);
    }
    return state;
  }
  void turn(double curvature_per_m) { feel(kSpeedMps * curvature_per_m); }
  /// The gyro learns its bias.
  void go_straight() {
    go(200, [&] { turn(0); });
  }
  void nowhere() {
    fusion_.add(FixInput{at(t_s_), 1, 900 + kSpeedMps * t_s_, INFINITY, 0.01, 0, FixKind::track,
                         track::Direction::forward, nullptr, SightingsFit::nowhere});
  }
  void find(double offset_m) {
    fusion_.add(FixInput{at(t_s_), 1, offset_m, 5, 0.9999, 0, FixKind::network, track::Direction::forward, {}});
  }

  /// What another fusion says now.
  [[nodiscard]] KnownPlace known_at(double offset_m) const {
    return {at(t_s_), {1, offset_m, track::Direction::forward}, kSpeedMps, 2, 2, 0.9999};
  }
  void take_over(const KnownPlace& known) {
    const auto place = place_at(straight_line(), known, at(t_s_), 4);
    ASSERT_TRUE(place);
    fusion_.add(*place);
  }
  void feel(double rate_rps) {
    for (int i = 0; i < 50; ++i)
      fusion_.add(ImuInput{at(t_s_ + 0.02 * i + 0.01), 0.01 * (i % 3), rate_rps + (i % 2 == 0 ? 1e-4 : -1e-4)});
  }

  Fusion fusion_ = fusion_at(900);
  [[nodiscard]] double told_m() const { return 900 + kSpeedMps * t_s_; }
  double t_s_ = 0;
};

// Where masts stand everywhere, every other one is where the map has one by chance.
TEST_F(WrongStart, IsNotConfirmedByLandmarksThatAgreeNowAndThen) {
  const auto gnss = [&] { fusion_.add(GnssInput{at(t_s_), 0, told_m() + 400, 1, 1}); };
  ASSERT_TRUE(go(200, gnss).place_in_doubt);
  uint32_t landmark = 0;
  const auto every_other = [&] {
    gnss();
    ++landmark;
    fusion_.add(fix_at(t_s_, told_m() + (landmark % 2 == 0 ? 0 : 40 + landmark), landmark));
  };
  EXPECT_TRUE(go(600, every_other).place_in_doubt) << "15 of 30 agree";
  const auto each = [&] {
    gnss();
    fusion_.add(fix_at(t_s_, told_m(), ++landmark));
  };
  EXPECT_FALSE(go(160, each).place_in_doubt) << "five in a row";
  EXPECT_FALSE(go(40, every_other).place_in_doubt) << "they are believed, whatever one says later";
}

TEST_F(WrongStart, IsNoPositionAfter300AndGivenUpAfter1000MetresOfTurningOtherwise) {
  go_straight();
  int second = 0;
  const auto bends = [&] { turn(++second / 10 % 2 == 0 ? 0.001 : -0.001); };
  EXPECT_EQ(go(200, bends).integrity, Integrity::degraded);
  auto state = go(300, bends);
  EXPECT_EQ(state.integrity, Integrity::unusable);
  EXPECT_TRUE(state.track_known);
  state = go(700, bends);
  EXPECT_FALSE(state.track_known);
  EXPECT_THAT(state.reason, HasSubstr("given up, the train turned otherwise"));
  EXPECT_NEAR(state.distance_m, 1400, 1);
  find(5000);
  state = go(100, [&] { turn(0); });
  EXPECT_TRUE(state.track_known);
  EXPECT_NEAR(state.position.offset_m, 5100, 1);
  EXPECT_EQ(state.reason.find("given up"), std::string::npos) << state.reason;
}

TEST_F(WrongStart, IsToldByTurningAlsoWhereItWasSearchedForAndNoSwitchWasPassed) {
  fusion_ = fusion_without_start();
  go_straight();
  find(told_m());
  EXPECT_THAT(go(100, [&] { turn(0); }).reason, Not(HasSubstr("turns otherwise")));
  EXPECT_THAT(go(300, [&] { turn(1.0 / 700); }).reason, HasSubstr("turns otherwise than this track"));
}

TEST_F(WrongStart, IsKeptWhereTheTrainTurnsAsTheTrackDoesButForSomeBumps) {
  go_straight();
  int second = 0;
  const auto bumps = [&] { turn(++second % 100 < 4 ? 0.001 : 0); };
  const auto state = go(9000, bumps);
  EXPECT_TRUE(state.track_known);
  EXPECT_EQ(state.integrity, Integrity::degraded);
}

// The train would be found by the one that had accused it: its antenna may be 200 m behind the cab, or the map shifted.
TEST_F(WrongStart, IsNoPositionButNotGivenUpWhereGnssAloneContradictsIt) {
  const auto elsewhere = [&] { fusion_.add(GnssInput{at(t_s_), 0, 1100 + kSpeedMps * t_s_, 1, 1}); };
  const auto state = go(5000, elsewhere);
  EXPECT_EQ(state.integrity, Integrity::unusable);
  EXPECT_TRUE(state.track_known);
}

TEST_F(WrongStart, IsGivenUpTwiceAsSoonWhereGnssContradictsItAsWellAsTheSightings) {
  const auto both = [&] {
    fusion_.add(GnssInput{at(t_s_), 0, 4000 + kSpeedMps * t_s_, 1, 1});
    nowhere();
  };
  EXPECT_TRUE(go(900, both).track_known);
  EXPECT_FALSE(go(300, both).track_known);
}

TEST_F(WrongStart, IsKeptWhereItIsTheGyroThatIsWrong) {
  go_straight();
  int second = 0;
  const auto bends = [&] {
    turn(++second / 10 % 2 == 0 ? 0.001 : -0.001);
    // The camera sees the curves where the map has them.
    if (second % 15 == 0)
      fusion_.add(FixInput{at(t_s_), 1, 900 + kSpeedMps * t_s_, 1, 0.99, 0, FixKind::curvature,
                           track::Direction::forward, nullptr});
  };
  const auto state = go(5000, bends);
  EXPECT_TRUE(state.track_known);
  EXPECT_EQ(state.integrity, Integrity::degraded) << state.reason;
}

TEST_F(WrongStart, IsKeptWhereALandmarkContradictsGnss) {
  fusion_.add(fix_at(t_s_, 900, 1));
  const auto state = go(3000, [&] { fusion_.add(GnssInput{at(t_s_), 0, 4000 + kSpeedMps * t_s_, 1, 1}); });
  EXPECT_TRUE(state.track_known);
  EXPECT_EQ(state.integrity, Integrity::unusable) << "but of the two nobody knows which is right";
}

TEST_F(WrongStart, IsGivenUpWhereNothingIsSightedThatFits) {
  const auto says = [&] { nowhere(); };
  EXPECT_TRUE(go(1900, says).track_known);
  const auto state = go(200, says);
  EXPECT_FALSE(state.track_known);
  EXPECT_THAT(state.reason, HasSubstr("given up, what was sighted fitted"));
}

// By a fusion that takes over from one whose place GNSS denied, or that was lost.
TEST_F(WrongStart, APlaceThatIsHandedOverInDoubtIsNoneUntilTwoLandmarksAgree) {
  fusion_ = fusion_without_start();
  go(20, [] {});
  KnownPlace denied = known_at(500);
  denied.in_doubt = true;
  take_over(denied);
  auto state = go(200, [] {});
  EXPECT_TRUE(state.track_known);
  EXPECT_EQ(state.integrity, Integrity::unusable) << state.reason;
  EXPECT_GE(std::min(state.over_m, state.under_m), 99);
  fusion_.add(fix_at(t_s_, 702, 1));
  state = go(20, [] {});
  EXPECT_EQ(state.integrity, Integrity::unusable) << "one alone may be another one";
  fusion_.add(fix_at(t_s_, 722, 2));
  state = go(20, [] {});
  EXPECT_EQ(state.integrity, Integrity::ok) << state.reason;
  EXPECT_NEAR(state.position.offset_m, 742, 1);
}

// On a straight line nothing speaks against it.
TEST_F(WrongStart, IsNeverOkAsLongAsNothingHasConfirmedIt) {
  for (int i = 0; i < 20; ++i) EXPECT_EQ(go(100, [] {}).reason, kOnlyTold);
}

// Masts at even distances agree wherever the train is, however many of them.
TEST_F(WrongStart, ThatIsRightIsOkFromTheLandmarkOnByWhichTheMatcherIsSure) {
  for (const uint32_t sure_at : {2, 20}) {
    fusion_ = fusion_at(900);
    t_s_ = 0;
    for (uint32_t landmark = 1; landmark < sure_at; ++landmark) {
      fusion_.add(fix_at(t_s_, told_m(), landmark));
      EXPECT_EQ(go(40, [] {}).reason, kOnlyTold) << landmark;
    }
    fusion_.add(sure_fix_at(t_s_, told_m(), sure_at));
    EXPECT_EQ(go(40, [] {}).reason, "");
  }
}

TEST_F(WrongStart, IsNotConfirmedByHowManyLandmarksAgreeWhateverTheyAre) {
  for (const auto kind : {track::LandmarkKind::balise, track::LandmarkKind::mast}) {
    auto map = std::make_shared<track::Map>(*straight_line());
    for (uint32_t id = 1; id <= 8; ++id) map->landmarks.push_back({id, kind, 1, 900 + 40.0 * id, 0, 0.1, ""});
    fusion_ = core::value_or_throw(
        Fusion::create({.camera_lag_s = kAnyLagS}, map, track::EdgePosition{1, 900, track::Direction::forward}));
    t_s_ = 0;
    for (uint32_t landmark = 1; landmark <= 8; ++landmark) {
      go(40, [] {});
      fusion_.add(fix_at(t_s_, told_m(), landmark));
      EXPECT_EQ(run(fusion_, t_s_, t_s_ + 0.02, kSpeedMps).reason, kOnlyTold) << landmark;
    }
  }
}

TEST_F(WrongStart, ThatGnssAgreesWithIsOkFromTheFirstLandmarkOnOrAtOnceWhereGnssIsSharp) {
  for (const uint8_t fix : {uint8_t{1}, uint8_t{4}, uint8_t{5}}) {
    for (const double hdop : {0.6, 1.0}) {
      fusion_ = fusion_at(900);
      t_s_ = 0;
      go(100, [] {});
      fusion_.add(GnssInput{at(t_s_), 0, told_m(), hdop, fix});
      EXPECT_EQ(go(1000, [] {}).reason, fix == 1 ? kToldAndGnss : "") << int{fix} << " at HDOP " << hdop;
      fusion_.add(fix_at(t_s_, told_m(), 1));
      EXPECT_EQ(go(40, [] {}).reason, "");
    }
  }
}

// A cab that looks the other way stands where it was told, too.
TEST_F(WrongStart, ThatGnssAgreedWithAtRestOnlyIsNoPositionWhenItContradictsUnderWay) {
  for (const uint8_t fix : {uint8_t{1}, uint8_t{4}}) {
    fusion_ = fusion_at(900);
    t_s_ = 0;
    const auto stand = [&] {
      fusion_.add(GnssInput{at(t_s_), 0, 900, 1, fix});
      return run(fusion_, t_s_, t_s_ + 1, 0);
    };
    for (; t_s_ < 10; t_s_ += 1) EXPECT_EQ(stand().reason, kOnlyTold) << int{fix};
    const auto gnss = [&] { fusion_.add(GnssInput{at(t_s_), 0, 900 - kSpeedMps * (t_s_ - 10), 1, fix}); };
    const auto state = go(300, gnss);
    EXPECT_EQ(state.integrity, Integrity::unusable) << state.reason;
    EXPECT_THAT(state.reason, HasSubstr(kOnlyTold));
    EXPECT_THAT(state.reason, Not(HasSubstr("GNSS agrees")));
  }
}

TEST_F(WrongStart, IsToldByTurningAlsoWhereMastsStandByChance) {
  go_straight();
  uint32_t second = 0;
  const auto masts = [&] {
    turn(++second % 20 < 10 ? 0.001 : -0.001);
    if (second % 3 == 0) fusion_.add(fix_at(t_s_, told_m(), second));
  };
  const auto state = go(600, masts);
  EXPECT_THAT(state.reason, HasSubstr("turns otherwise than this track"));
  EXPECT_EQ(state.integrity, Integrity::unusable) << state.reason;
}

TEST_F(WrongStart, IsNotDeniedByGnssThatWandersAtRest) {
  const auto stand = [&](double off_m) {
    fusion_.add(GnssInput{at(t_s_), 0, 900 + off_m, 1, 1});
    return run(fusion_, t_s_, t_s_ + 1, 0);
  };
  for (; t_s_ < 10; t_s_ += 1) stand(0);
  TrainEstimate state;
  for (; t_s_ < 20; t_s_ += 1) state = stand(60);
  EXPECT_THAT(state.reason, HasSubstr("GNSS contradicts"));
  EXPECT_EQ(state.integrity, Integrity::degraded) << state.reason;
}

TEST_F(WrongStart, ThatTwoFixesHaveMovedIsNotJudgedByHowItTurnedAtThePlaceBefore) {
  go_straight();
  int second = 0;
  const auto bends = [&] { turn(++second % 20 < 10 ? 0.001 : -0.001); };
  EXPECT_EQ(go(400, bends).integrity, Integrity::unusable);
  for (const uint32_t landmark : {1, 2}) {
    fusion_.add(fix_at(t_s_, told_m() + 60, landmark));
    go(40, [&] { turn(0); });
  }
  const auto state = go(600, [&] { turn(0); });
  EXPECT_THAT(state.reason, Not(HasSubstr("turns otherwise")));
  EXPECT_EQ(state.integrity, Integrity::degraded) << state.reason;
}

TEST_F(WrongStart, ThatGnssAgreesWithIsOkFromTheThirdCurveOn) {
  go(100, [] {});
  fusion_.add(GnssInput{at(t_s_), 0, told_m(), 1, 1});
  const auto bend = [&] {
    fusion_.add(FixInput{at(t_s_), 1, told_m(), 1, 0.9999, 0, FixKind::curvature, track::Direction::forward, {}});
    return go(100, [] {}).reason;
  };
  EXPECT_EQ(bend(), kToldAndGnss);
  EXPECT_EQ(bend(), kToldAndGnss);
  EXPECT_EQ(bend(), "");
}

TEST_F(WrongStart, ThatIsRightIsOkFromTheThirdCurveOnThatFitsToThreeMetres) {
  const auto bend = [&](double off_m) {
    fusion_.add(
        FixInput{at(t_s_), 1, told_m() + off_m, 1, 0.9999, 0, FixKind::curvature, track::Direction::forward, {}});
    return go(100, [] {}).reason;
  };
  EXPECT_EQ(bend(0), kOnlyTold);
  EXPECT_EQ(bend(4), kOnlyTold);
  EXPECT_EQ(bend(1), kOnlyTold);
  EXPECT_EQ(bend(1), "");
}

TEST_F(WrongStart, OfAFusionThatWasNotOkIsToldTheNextOneOnly) {
  for (const bool only_told : {false, true}) {
    fusion_ = fusion_without_start();
    t_s_ = 0;
    go(20, [] {});
    KnownPlace known = known_at(920);
    known.only_told = only_told;
    take_over(known);
    EXPECT_EQ(go(40, [] {}).reason, only_told ? kOnlyTold : "");
  }
}

/// Whole rides, with map_matcher's real matchers and its search of the whole map in the loop.
struct Sensors {
  std::string name;
  bool gnss;
  bool sightings;
};
class WrongStartRide : public testing::TestWithParam<Sensors> {};

TEST_P(WrongStartRide, EndsWhereTheTrainIs) {
  auto plan = train::campaign_plan();
  plan.duration_s = 480;
  plan.landmark_spacing_m = 0;
  plan.gnss = GetParam().gnss;
  plan.sightings = GetParam().sightings;
  plan.start_wrong_m = 4000;
  constexpr int kRides = 4;
  int found = 0;
  for (int ride = 0; ride < kRides; ++ride) {
    const train::TrainSimulation simulation(plan, train::seed_of_run(77, static_cast<uint64_t>(ride)));
    auto fusion = core::value_or_throw(Fusion::create({}, simulation.map, simulation.start()));
    double usable_outside_m = 0;
    int ok_outside = 0;
    TrainEstimate last;
    const auto verdict = train::judge(simulation, fusion, 0, [&](const TrainEstimate& state, double error_m) {
      const bool outside = error_m > state.over_m || -error_m > state.under_m;
      if (outside && state.integrity != Integrity::unusable) usable_outside_m = state.distance_m;
      if (outside && state.integrity == Integrity::ok) ++ok_outside;
      last = state;
    });
    EXPECT_GT(verdict.outside, 0U) << "nobody knows at first";
    EXPECT_EQ(verdict.outside_again, 0U) << "ride " << ride;
    EXPECT_EQ(ok_outside, 0) << "ride " << ride;
    EXPECT_LT(usable_outside_m, 3000) << "ride " << ride;
    found += last.track_known && verdict.placeless > 0 ? 1 : 0;
  }
  EXPECT_GE(found, kRides / 2);
}

// What GNSS cannot tell apart is never ok.
TEST(WrongStartNearby, IsNeverOkWhileItIsOutside) {
  auto plan = train::campaign_plan();
  plan.start_wrong_m = 40;
  uint64_t outside = 0;
  uint64_t ok = 0;
  for (int ride = 0; ride < 8; ++ride) {
    const train::TrainSimulation simulation(plan, train::seed_of_run(88004, static_cast<uint64_t>(ride)));
    auto fusion = core::value_or_throw(Fusion::create({}, simulation.map, simulation.start()));
    const auto verdict = train::judge(simulation, fusion, 0, {});
    EXPECT_EQ(verdict.outside_ok, 0U) << "ride " << ride;
    outside += verdict.outside;
    ok += verdict.states - verdict.not_ok;
  }
  EXPECT_GT(outside, 0U) << "nobody knows at first";
  EXPECT_GT(ok, 0U) << "it is found";
}

INSTANTIATE_TEST_SUITE_P(By, WrongStartRide,
                         testing::Values(Sensors{"Gnss", true, false}, Sensors{"Sightings", false, true},
                                         Sensors{"Turning", false, false}),
                         [](const auto& one) { return one.param.name; });

}  // namespace
}  // namespace railfix::fusion::wrong_start_test
