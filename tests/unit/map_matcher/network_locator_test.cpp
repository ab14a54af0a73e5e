#include "map_matcher/network_locator.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "support/sensed_ride.hpp"

namespace railfix::map_matcher {
namespace {

constexpr double kLineM = 6000;

std::vector<track::Element> random_line(core::Random& random) {
  std::vector<track::Element> elements;
  double sum_m = 0;
  while (sum_m < kLineM) {
    const double curvature = (random.uniform() < 0.5 ? -1 : 1) / random.uniform(400, 1500);
    for (const auto& e :
         {track::Element{random.uniform(150, 700), 0, 0}, track::Element{80, 0, curvature},
          track::Element{random.uniform(80, 300), curvature, curvature}, track::Element{80, curvature, 0}}) {
      elements.push_back(e);
      sum_m += e.length_m;
    }
  }
  return elements;
}

std::shared_ptr<const NetworkIndex> network_of(const std::vector<std::vector<track::Element>>& lines) {
  auto map = std::make_shared<track::Map>();
  for (const auto& line : lines) {
    const auto id = static_cast<uint32_t>(map->edges.size() + 1);
    map->edges.push_back({id, "", 2 * id, 2 * id + 1, "", track::Alignment::chained({10000.0 * id, 0, 0}, line)});
  }
  return std::make_shared<const NetworkIndex>(map);
}

Location ride(const std::shared_ptr<const NetworkIndex>& index, const track::Route& route, double from_m, double to_m,
              double scale, double every_m = 1e9) {
  testing::RideErrors errors;
  errors.odometer_scale = scale;
  errors.turn_bias_rps = 0;
  errors.turn_noise_rps = 0;
  errors.step_turn_noise_rad = 3e-4;
  const testing::VehicleHeading heading([&](double m) { return route.curvature_at(m); }, from_m - 1, to_m + 1, errors);
  testing::RideSensors sensors(errors, 5);
  NetworkLocator locator({}, index);
  for (double m = from_m; m < to_m; m += 1) {
    const auto s = sensors.step(heading, 0, m, m + 1, 0.05);
    locator.move(s.way_m, s.turn_rad, s.turn_sigma_rad);
    for (const Mark& mark : index->marks_on(route.leg_at(m).run)) {
      if (mark.along_m > m && mark.along_m <= m + 1) locator.sight({0, mark.kind, mark.along_m - m - 1, 0, 0.2, 0.95});
    }
    if (std::fmod(m - from_m, every_m) == every_m - 1) static_cast<void>(locator.locate());
  }
  return locator.locate();
}

class NetworkLocatorTest : public ::testing::Test {
 protected:
  NetworkLocatorTest() {
    core::Random random(3);
    for (int i = 0; i < 30; ++i) lines_.push_back(random_line(random));
  }
  std::vector<std::vector<track::Element>> lines_;
};

TEST_F(NetworkLocatorTest, FindsTheOnePlaceInEitherDirectionWithAWrongScale) {
  const auto index = network_of(lines_);
  for (const bool forward : {true, false}) {
    const track::Route route({index->map().edge(17), forward},
                             forward ? 0 : index->map().edge(17)->alignment.length_m(), 0);
    const auto location = ride(index, route, 700, 4200, forward ? 0.017 : -0.015);
    ASSERT_FALSE(location.places.empty());
    EXPECT_TRUE(location.certain());
    const auto& best = location.places.front();
    EXPECT_EQ(best.place.edge, 17U);
    EXPECT_NEAR(route.distance_of(best.place, 4200).value_or(0), 4200, 15);
    EXPECT_NEAR(best.scale, forward ? 1 - 0.017 : 1 + 0.015, 0.006);
  }
}

TEST_F(NetworkLocatorTest, TwoPlacesThatLookTheSameAreBothNamedAndNeitherIsCertain) {
  lines_[20] = lines_[16];
  const auto index = network_of(lines_);
  const auto location = ride(index, track::Route({index->map().edge(17), true}, 0, 0), 700, 4200, 0.01);
  ASSERT_GE(location.places.size(), 2U);
  EXPECT_FALSE(location.certain());
  EXPECT_FALSE(location.place_certain());
  EXPECT_NEAR(location.places[0].probability, 0.5, 0.01);
  EXPECT_NEAR(location.places[1].probability, 0.5, 0.01);
}

TEST_F(NetworkLocatorTest, ATrackThatIsNotOnTheMapIsNeverCertain) {
  const auto index = network_of(lines_);
  core::Random random(99);
  for (int i = 0; i < 3; ++i) {
    const auto elsewhere = network_of({random_line(random)});
    const auto location = ride(index, track::Route({elsewhere->map().edge(1), true}, 0, 0), 300, 5000, 0.01);
    EXPECT_FALSE(location.certain());
    EXPECT_FALSE(location.place_certain());
  }
}

TEST_F(NetworkLocatorTest, WhatWasLookedForBeforeIsTakenFromMemoryAndGivesTheSame) {
  const auto index = network_of(lines_);
  const track::Route route({index->map().edge(17), true}, 0, 0);
  const auto once = ride(index, route, 700, 4200, 0.01);
  const auto often = ride(index, route, 700, 4200, 0.01, 250);
  ASSERT_FALSE(often.places.empty());
  EXPECT_TRUE(often.certain());
  EXPECT_EQ(often.places.front().place.edge, once.places.front().place.edge);
  EXPECT_NEAR(often.places.front().place.offset_m, once.places.front().place.offset_m, 0.5);
}

// Two lines bend alike, a balise stands on one of them.
TEST_F(NetworkLocatorTest, ALandmarkTellsPlacesApartThatBendAlike) {
  lines_[20] = lines_[16];
  const auto bare = network_of(lines_);
  auto map = std::make_shared<track::Map>(bare->map());
  for (const double offset_m : {1500.0, 2200.0, 3100.0}) {
    const auto id = static_cast<uint32_t>(map->landmarks.size() + 1);
    map->landmarks.push_back({id, track::LandmarkKind::balise, 21, offset_m, 0, 0.1, ""});
  }
  const auto index = std::make_shared<const NetworkIndex>(map);
  const auto location = ride(index, track::Route({index->map().edge(21), true}, 0, 0), 700, 4200, 0.01);
  ASSERT_FALSE(location.places.empty());
  EXPECT_EQ(location.places.front().place.edge, 21U);
  EXPECT_TRUE(location.certain()) << to_string(location.doubt);
}

TEST_F(NetworkLocatorTest, OneStretchAloneIsNotEnoughToBeCertain) {
  const auto index = network_of(lines_);
  const auto location = ride(index, track::Route({index->map().edge(17), true}, 0, 0), 700, 1600, 0.0);
  EXPECT_FALSE(location.certain());
}

TEST_F(NetworkLocatorTest, AStraightSaysNothing) {
  lines_[5] = {{kLineM, 0, 0}};
  const auto index = network_of(lines_);
  const auto location = ride(index, track::Route({index->map().edge(6), true}, 0, 0), 300, 5000, 0.0);
  EXPECT_FALSE(location.certain());
}

}  // namespace
}  // namespace railfix::map_matcher
