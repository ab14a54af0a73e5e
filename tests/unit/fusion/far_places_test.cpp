// Places that are not where the path was begun: beyond its ends, round a loop, and a start that was told wrongly.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/units.hpp"
#include "straight_run.hpp"

namespace railfix::fusion {
namespace {

using testing::HasSubstr;
using testing::Not;

/// 600 km in edges of 10 km, all drawn northwards.
std::shared_ptr<const track::Map> long_line() {
  auto map = std::make_shared<track::Map>();
  for (uint32_t i = 0; i < 60; ++i) {
    map->edges.push_back(
        {i + 1, "", i + 1, i + 2, "", track::Alignment::chained({0, 10000.0 * i, 0}, {{10000, 0, 0}})});
    if (i > 0) map->connections.push_back({i + 1, i, i + 1, false});
  }
  return map;
}

/// A train that needs an hour for 400 km, by a landmark every 10 km.
TrainEstimate run_far(double to_m, const track::EdgePosition& start) {
  constexpr double kStepM = 100;
  auto fusion = core::value_or_throw(Fusion::create({}, long_line(), start));
  const double from_m = 10000.0 * (start.edge - 1) + start.offset_m;
  const double along = start.direction == track::Direction::reverse ? -1 : 1;
  const double ahead = to_m > from_m ? 1 : -1;
  std::optional<TrainEstimate> last;
  double t_s = 0;
  uint32_t landmark = 0;
  for (double place_m = from_m; std::abs(to_m - place_m) > kStepM / 2;) {
    t_s += 1;
    place_m += ahead * kStepM;
    if (auto state = fusion.add(OdometryInput{at(t_s), at(t_s - 1), along * ahead * kStepM, 0.01, true})) last = state;
    if (std::fmod(place_m, 10000) != 5000) continue;
    auto fix = sure_fix_at(t_s + 0.001, 5000, ++landmark);
    fix.edge = static_cast<uint32_t>(place_m / 10000) + 1;
    fix.direction = start.direction;
    fusion.add(fix);
  }
  return last.value_or(TrainEstimate{});
}

TEST(FarPlaces, ATrainRunsFurtherThanThePathWasBegun) {
  const auto state = run_far(520000, {1, 0, track::Direction::forward});
  EXPECT_EQ(state.integrity, Integrity::ok) << state.reason;
  EXPECT_NEAR(10000.0 * (state.position.edge - 1) + state.position.offset_m, 520000, 5);
}

TEST(FarPlaces, AndBackwardsWithItsCabBehind) {
  const auto state = run_far(10000, {30, 0, track::Direction::forward});
  EXPECT_EQ(state.integrity, Integrity::ok) << state.reason;
  EXPECT_NEAR(10000.0 * (state.position.edge - 1) + state.position.offset_m, 10000, 5);
  EXPECT_EQ(state.position.direction, track::Direction::forward);
}

TEST(FarPlaces, BeyondTheEndOfTheMapTheIntervalHoldsTheTrain) {
  for (const double speed_mps : {20.0, -20.0}) {
    auto fusion = fusion_at(speed_mps > 0 ? 19900 : 100);
    for (double to_s = 1; to_s <= 20; ++to_s) {
      const auto state = run(fusion, to_s - 1, to_s, speed_mps);
      const double train_m = (speed_mps > 0 ? 19900 : 100) + speed_mps * to_s;
      EXPECT_GE(state.position.offset_m + state.under_m, train_m);
      EXPECT_LE(state.position.offset_m - state.over_m, train_m);
      const bool told = state.reason.find("beyond the end of the mapped track") != std::string::npos;
      EXPECT_TRUE(told || to_s < 7);
    }
  }
}

// Its end is not where the train is, and GNSS does not contradict the odometer there.
TEST(FarPlaces, BeyondTheEndOfTheMapGnssHoldsNobodyBack) {
  auto fusion = fusion_at(19500);
  TrainEstimate state;
  for (double to_s = 1; to_s <= 40; ++to_s) {
    const double train_m = 19500 + 20 * to_s;
    state = run(fusion, to_s - 1, to_s, 20);
    fusion.add(GnssInput{at(to_s), 0, train_m, 1, 1});
    EXPECT_EQ(state.reason.find("GNSS contradicts"), std::string::npos) << state.reason;
  }
  EXPECT_NEAR(state.distance_m, 800, 1);
  EXPECT_GE(state.position.offset_m + state.under_m, 20300);
}

// There is no track of this map: nothing is lost by looking for the train on all of it.
TEST(FarPlaces, FarBeyondTheEndOfTheMapThePlaceIsGivenUp) {
  auto fusion = fusion_at(19500);
  const auto near = run(fusion, 0, 60, 20);
  EXPECT_TRUE(near.track_known) << "700 m beyond the end";
  const auto far = run(fusion, 60, 95, 20);
  EXPECT_FALSE(far.track_known);
  EXPECT_THAT(far.reason, HasSubstr("has run far beyond the end of the mapped track"));
  EXPECT_NEAR(far.distance_m, 1900, 1);
  auto back = fix_at(95, 300, 0);
  back.kind = FixKind::network;
  fusion.add(back);
  EXPECT_NEAR(run(fusion, 95, 96, 20).position.offset_m, 320, 5) << "behind the gap";
}

TEST(FarPlaces, AFixForTheOtherDirectionIsNoPlaceOnTheWay) {
  auto fusion = fusion_at(1000);
  run(fusion, 0, 10, 20);
  auto fix = fix_at(10, 1203, 1);  // where a landmark would be seen from the other side
  fix.direction = track::Direction::reverse;
  fusion.add(fix);
  const auto state = run(fusion, 10, 11, 20);
  EXPECT_NEAR(state.position.offset_m, 1220, 0.1);
  EXPECT_LT(state.track_probability, 0.01);
}

TEST(FarPlaces, OnARingALandmarkIsThatOfThisRound) {
  constexpr double kRoundM = 2000;
  const double curvature_per_m = 2 * core::kPi / kRoundM;
  auto map = std::make_shared<track::Map>();
  map->edges = {{1, "ring", 1, 1, "", track::Alignment::chained({}, {{kRoundM, curvature_per_m, curvature_per_m}})}};
  map->connections = {{1, 1, 1, false}};
  auto fusion = core::value_or_throw(Fusion::create({}, map, track::EdgePosition{1, 0, track::Direction::forward}));
  for (int i = 1; i <= 12; ++i) {  // half a round each, with a landmark at 1000 m and one at 0
    run(fusion, 50 * (i - 1), 50 * i - 10, 20);
    fusion.add(sure_fix_at(50 * i - 10, i % 2 == 0 ? 1800 : 800, static_cast<uint32_t>(1 + i % 2)));
    const auto state = run(fusion, 50 * i - 10, 50 * i, 20);
    EXPECT_EQ(state.integrity, Integrity::ok) << state.reason;
    EXPECT_EQ(state.reference, static_cast<uint32_t>(1 + i % 2));
  }
}

TEST(FarPlaces, AStartThatGnssContradictsIsNotUsed) {
  auto fusion = fusion_at(1000);
  TrainEstimate state;
  const auto go_on = [&](int from_s, int to_s, double gnss_off_m) {
    for (int t_s = from_s; t_s < to_s; ++t_s) {
      state = run(fusion, t_s, t_s + 1, 20);
      fusion.add(GnssInput{at(t_s + 1.001), 0, 1020 + 20 * t_s + gnss_off_m, 1.0, 1});
    }
  };
  go_on(0, 10, 1000);
  EXPECT_EQ(state.integrity, Integrity::unusable);
  EXPECT_THAT(state.reason, HasSubstr("GNSS contradicts the position"));
  for (int landmark = 1; landmark <= 5; ++landmark) {  // five in a row are no chance
    EXPECT_EQ(state.integrity, Integrity::unusable) << landmark;
    fusion.add(fix_at(10 * landmark, 1000 + 200 * landmark, static_cast<uint32_t>(landmark)));
    go_on(10 * landmark, 10 * landmark + 10, 1000);
  }
  EXPECT_EQ(state.integrity, Integrity::degraded) << state.reason;
}

// Of all places on its way the end is the nearest one, and the train cannot be there.
TEST(FarPlaces, NorIsOneThatGnssContradictsFromBeyondTheEndOfItsWay) {
  auto fusion = fusion_at(1000);
  TrainEstimate state;
  for (int t_s = 0; t_s < 10; ++t_s) {
    state = run(fusion, t_s, t_s + 1, 20);
    fusion.add(GnssInput{at(t_s + 1.001), 0, 26000 + 20.0 * t_s, 1.0, 1});
  }
  EXPECT_EQ(state.integrity, Integrity::unusable);
  EXPECT_THAT(state.reason, HasSubstr("GNSS contradicts the position"));
}

// Of a train that stops in front of the buffers.
TEST(FarPlaces, ButNotOneThatItPutsSomeMetresFurtherBeyondTheEnd) {
  auto fusion = fusion_at(19994);
  fusion.add(fix_at(0.5, 19994, 1));
  TrainEstimate state;
  for (int t_s = 0; t_s < 20; ++t_s) {
    state = run(fusion, t_s, t_s + 1, 0);
    fusion.add(GnssInput{at(t_s + 1.001), 0, 20005, 1.0, 1});
  }
  EXPECT_LT(state.under_m, 6) << "it knows that it is not beyond the end";
  EXPECT_THAT(state.reason, Not(HasSubstr("GNSS contradicts")));
}

}  // namespace
}  // namespace railfix::fusion
