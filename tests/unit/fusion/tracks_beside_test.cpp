// A start that was told on the neighbour of the right track is not confirmed by what both would have seen.
#include <gtest/gtest.h>

#include "core/units.hpp"
#include "straight_run.hpp"
#include "track/aside.hpp"
#include "track/tracks_beside.hpp"

namespace railfix::fusion {
namespace {

constexpr double kApartM = 4;

/// Two tracks of 5 km side by side, the second one drawn the other way when `against`; masts to the right of each every
/// 100 m, a balise on the first one at 1500 m.
std::shared_ptr<const track::Map> double_track(bool against) {
  auto map = std::make_shared<track::Map>();
  const auto first = track::Alignment::chained({0, 0, 0}, {{5000, 0, 0}});
  const auto second = against ? track::Alignment::chained({kApartM, 5000, core::kPi}, {{5000, 0, 0}})
                              : track::Alignment::chained({kApartM, 0, 0}, {{5000, 0, 0}});
  map->edges = {{1, "first", 1, 2, "", first}, {2, "second", 3, 4, "", second}};
  uint32_t id = 0;
  for (double m = 100; m < 5000; m += 100) {
    map->landmarks.push_back({++id, track::LandmarkKind::mast, 1, m, -3, 0.1, ""});
    map->landmarks.push_back(
        {++id, track::LandmarkKind::mast, 2, against ? 5000 - m : m, against ? 3.0 : -3.0, 0.1, ""});
  }
  map->landmarks.push_back({++id, track::LandmarkKind::balise, 1, 1500, 0, 0.1, ""});
  return map;
}

FixInput fix_of(const track::Landmark& landmark, double t_s) {
  return {at(t_s),     landmark.edge,     landmark.offset_m,         0.1,     0.9999,
          landmark.id, FixKind::landmark, track::Direction::forward, nullptr, SightingsFit::here};
}

constexpr const char* kAlikeBeside =
    "the place was only told, and what agrees is the same on a track beside it: waits for a balise or a frog";

TEST(TracksBeside, WhatStandsBesideBothConfirmsNoStartThatWasTold) {
  for (const bool against : {false, true}) {
    const auto map = double_track(against);
    auto fusion = core::value_or_throw(Fusion::create({}, map, track::EdgePosition{1, 50, track::Direction::forward}));
    double t_s = 0;
    TrainEstimate state;
    for (const auto& landmark : map->landmarks) {
      if (landmark.edge != 1 || landmark.kind != track::LandmarkKind::mast || landmark.offset_m > 1450) continue;
      const double there_s = (landmark.offset_m - 50) / 20;
      state = run(fusion, t_s, there_s, 20);
      t_s = there_s;
      fusion.add(fix_of(landmark, t_s));
    }
    state = run(fusion, t_s, 72, 20);
    EXPECT_EQ(state.reason, kAlikeBeside) << "after 14 masts, against " << against;
    state = run(fusion, 72, 72.5, 20);
    fusion.add(fix_of(map->landmarks.back(), 72.5));
    state = run(fusion, 72.5, 73, 20);
    EXPECT_EQ(state.integrity, Integrity::ok) << state.reason;
  }
}

// How far along the track it is, is known: the gyro is no more believed than beside landmarks that confirm the start.
TEST(TracksBeside, AStartThatBothWouldHaveHadIsKeptOverSomeBumps) {
  const auto map = double_track(false);
  auto fusion = core::value_or_throw(Fusion::create({}, map, track::EdgePosition{1, 50, track::Direction::forward}));
  TrainEstimate state;
  double t_s = 0;
  const auto ride_to = [&](double there_s) {
    for (; t_s < there_s; t_s += 0.5) {
      const bool bump = std::fmod(t_s, 60) > 55;
      for (int i = 0; i < 25; ++i) {
        const double turn_rps = (bump ? 0.02 : 0) + (i % 2 == 0 ? 1e-4 : -1e-4);
        fusion.add(ImuInput{at(t_s + 0.02 * i + 0.01), 0.01 * (i % 3), turn_rps});
      }
      state = run(fusion, t_s, t_s + 0.5, 20);
    }
  };
  for (const auto& landmark : map->landmarks) {
    if (landmark.edge != 1 || landmark.kind != track::LandmarkKind::mast) continue;
    ride_to((landmark.offset_m - 50) / 20);
    fusion.add(fix_of(landmark, t_s));
  }
  EXPECT_TRUE(state.track_known);
  EXPECT_EQ(state.integrity, Integrity::degraded) << state.reason;
  EXPECT_EQ(state.reason, kAlikeBeside);
}

TEST(TracksBeside, GnssSaysNothingOfAStartBesideAnotherTrack) {
  for (const bool alone : {false, true}) {
    auto map = std::make_shared<track::Map>(*double_track(false));
    if (alone) map->edges.pop_back();
    std::erase_if(map->landmarks, [](const track::Landmark&) { return true; });
    auto fusion = core::value_or_throw(Fusion::create({}, map, track::EdgePosition{1, 50, track::Direction::forward}));
    for (int i = 0; i < 40; ++i) {
      run(fusion, i, i + 1, 20);
      fusion.add(GnssInput{at(i + 1), 0, 50 + 20.0 * (i + 1), 1.0, 1});
    }
    const auto state = run(fusion, 40, 40.5, 20);
    EXPECT_EQ(state.reason, alone ? kToldAndGnss : kAlikeBeside);
  }
}

TEST(TracksBeside, APlaceNearTheEndOfAnEdgeIsNotBesideTheNextOne) {
  auto map = std::make_shared<track::Map>();
  map->edges = {{1, "a", 1, 2, "", track::Alignment::chained({0, 0, 0}, {{1000, 0, 0}})},
                {2, "b", 2, 3, "", track::Alignment::chained({0, 1000, 0}, {{1000, 0, 0}})},
                {3, "beside", 4, 5, "", track::Alignment::chained({20, 0, 0}, {{2000, 0, 0}})}};
  map->landmarks = {{1, track::LandmarkKind::mast, 1, 999, 3, 0.1, ""},
                    {2, track::LandmarkKind::mast, 2, 1, 3, 0.1, ""}};
  const track::TracksBeside beside(map);
  EXPECT_FALSE(beside.any_at({1, 995, track::Direction::forward}));
  EXPECT_FALSE(beside.has_alike(map->landmarks[0]));
  EXPECT_FALSE(beside.many_at(2, 500));
  EXPECT_TRUE(beside.many_at(10, 500)) << "10 m from either";
}

TEST(TracksBeside, AMastWithoutASideMayBeTheSameOne) {
  auto map = std::make_shared<track::Map>();
  map->edges = {{1, "a", 1, 2, "", track::Alignment::chained({0, 0, 0}, {{1000, 0, 0}})},
                {2, "b", 3, 4, "", track::Alignment::chained({4, 0, 0}, {{1000, 0, 0}})}};
  for (const auto& [other_m, is_alike] : {std::pair(3.1, true), {0.0, true}, {-3.1, false}}) {
    map->landmarks = {{1, track::LandmarkKind::mast, 1, 500, 3.1, 0.1, ""},
                      {2, track::LandmarkKind::mast, 2, 500, other_m, 0.1, ""}};
    EXPECT_EQ(track::TracksBeside(map).has_alike(map->landmarks[0]), is_alike) << other_m;
  }
}

// Of a double track with masts outside: 3 m from its own track, 7 m from the other one, which sees it as well.
TEST(TracksBeside, AMastBeyondItsTrackIsTheSameOneFromTheOtherWhereNobodyMeasuredHowFarAsideItStands) {
  auto map = std::make_shared<track::Map>();
  map->edges = {{1, "a", 1, 2, "", track::Alignment::chained({0, 0, 0}, {{1000, 0, 0}})},
                {2, "b", 3, 4, "", track::Alignment::chained({4, 0, 0}, {{1000, 0, 0}})},
                {3, "c", 5, 6, "", track::Alignment::chained({-8, 1000, core::kPi}, {{1000, 0, 0}})}};
  const auto is_alike = [&](double lateral_m, double sigma_m = 0.1) {
    map->landmarks = {{1, track::LandmarkKind::mast, 1, 500, lateral_m, sigma_m, ""}};
    return track::TracksBeside(map).has_alike(map->landmarks[0]);
  };
  EXPECT_TRUE(is_alike(track::kMastBesideM));
  EXPECT_TRUE(is_alike(3.1, 3)) << "drawn to metres";
  EXPECT_FALSE(is_alike(3.1)) << "7.1 m aside nobody takes it for one at 3.1 m";
  EXPECT_FALSE(is_alike(-2)) << "between both";
  EXPECT_TRUE(is_alike(0));
}

// Two of 5 m each on the other track, drawn the other way, of which one lies on its next edge.
TEST(TracksBeside, WhatTheMapHasWrongMayBeTheSameOneOnTheOtherTracksNextEdgeAsWell) {
  auto map = std::make_shared<track::Map>();
  const auto beside = [](double from_m, double to_m) {
    return track::Alignment::chained({4, from_m, core::kPi}, {{from_m - to_m, 0, 0}});
  };
  map->edges = {{1, "a", 1, 2, "", track::Alignment::chained({0, 0, 0}, {{1000, 0, 0}})},
                {2, "b", 3, 4, "", beside(1000, 500)},
                {3, "b2", 4, 5, "", beside(500, 0)}};
  map->connections = {{4, 2, 3, false}};
  for (const auto& [edge, offset_m] : {std::pair(2U, 494.0), {3U, 6.0}}) {
    for (const double sigma_m : {0.1, 3.0}) {
      map->landmarks = {{1, track::LandmarkKind::portal_in, 1, 500, 0, sigma_m, ""},
                        {2, track::LandmarkKind::portal_out, edge, offset_m, 0, sigma_m, ""}};
      EXPECT_EQ(track::TracksBeside(map).has_alike(map->landmarks[0]), sigma_m > 1) << edge << " " << sigma_m;
    }
  }
}

}  // namespace
}  // namespace railfix::fusion
