#include "map_matcher/locate/network_locator.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <ctime>
#include <limits>
#include <optional>
#include <utility>

#include "core/random.hpp"
#include "core/time.hpp"
#include "core/units.hpp"
#include "map_matcher/map_matcher.hpp"
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

testing::RideErrors errors_of(double scale) {
  testing::RideErrors errors;
  errors.odometer_scale = scale;
  errors.turn_bias_rps = 0;
  errors.turn_noise_rps = 0;
  errors.step_turn_noise_rad = 3e-4;
  return errors;
}

/// On a track that wanders about the mapped one, its heading by wander_rad.
Location ride(const std::shared_ptr<const NetworkIndex>& index, const track::Route& route, double from_m, double to_m,
              double scale, double every_m = 1e9, double wander_rad = 0) {
  constexpr double kPerM = 2 * core::kPi / 90;
  const auto errors = errors_of(scale);
  const testing::VehicleHeading heading(
      [&](double m) { return route.curvature_at(m) + wander_rad * kPerM * std::cos(kPerM * m); }, from_m - 1, to_m + 1,
      errors);
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

/// A train that runs to one place after the other, in steps as short as those from picture to picture.
class Shuttle {
 public:
  Shuttle(const std::shared_ptr<const NetworkIndex>& index, double from_m) : locator_({}, index), at_m_(from_m) {}
  void run(const track::Route& route, double to_m, double step_m = 0.5) {
    const testing::VehicleHeading heading([&](double m) { return route.curvature_at(m); }, std::min(at_m_, to_m) - 30,
                                          std::max(at_m_, to_m) + 1, errors_);
    const double way_m = to_m < at_m_ ? -step_m : step_m;
    for (; std::abs(to_m - at_m_) > 0.5 * step_m; at_m_ += way_m) {
      const auto s = sensors_.step(heading, 0, at_m_, at_m_ + way_m, 0.05);
      locator_.move(s.way_m, s.turn_rad, s.turn_sigma_rad);
      if (prepares) locator_.prepare();
    }
  }
  /// Stands for so many pictures, of which the odometer errs by centimetres.
  void stand(int pictures) {
    core::Random random(8);
    double last_m = 0;
    for (int i = 0; i < pictures; ++i) {
      const double off_m = 0.02 * random.normal();
      locator_.move(off_m - last_m, 1e-4 * random.normal(), 1e-4);
      last_m = off_m;
    }
  }
  NetworkLocator& locator() { return locator_; }
  bool prepares = false;

 private:
  testing::RideErrors errors_ = errors_of(0.01);
  testing::RideSensors sensors_{errors_, 5};
  NetworkLocator locator_;
  double at_m_;
};

void expect_right(const Location& location, const track::Route& route, double at_m) {
  ASSERT_FALSE(location.places.empty());
  EXPECT_TRUE(location.certain()) << to_string(location.doubt);
  EXPECT_NEAR(route.distance_of(location.places.front().place, at_m).value_or(0), at_m, 15);
  EXPECT_EQ(location.places.front().place.direction, route.position_at(at_m).direction);
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

TEST_F(NetworkLocatorTest, ATrainThatBacksIsFoundAndItsOwnFrontIsTold) {
  const auto index = network_of(lines_);
  for (const bool forward : {true, false}) {
    const track::Route route({index->map().edge(17), forward},
                             forward ? 0 : index->map().edge(17)->alignment.length_m(), 0);
    Shuttle train(index, 4900);
    train.run(route, 1400);
    expect_right(train.locator().locate(), route, 1400);
  }
}

TEST_F(NetworkLocatorTest, ATrainThatSetsBackAndGoesOnIsFound) {
  const auto index = network_of(lines_);
  const track::Route route({index->map().edge(17), true}, 0, 0);
  for (const double back_m : {30.0, 100.0, 300.0}) {
    Shuttle train(index, 700);
    train.run(route, 2200);
    train.run(route, 2200 - back_m);
    EXPECT_TRUE(train.locator().locate().places.empty()) << back_m << " m back";
    train.run(route, 4200);
    EXPECT_GT(train.locator().way_m(), 3400);
    expect_right(train.locator().locate(), route, 4200);
  }
}

TEST_F(NetworkLocatorTest, ATrainThatTurnsBackForGoodIsFoundOnTheWayBack) {
  const auto index = network_of(lines_);
  const track::Route route({index->map().edge(17), true}, 0, 0);
  Shuttle train(index, 2500);
  train.run(route, 4500);
  train.run(route, 700);
  expect_right(train.locator().locate(), route, 700);
  EXPECT_LT(train.locator().way_m(), 3900) << "no metre twice";
}

TEST_F(NetworkLocatorTest, RockingAtAHaltDoesNoHarm) {
  const auto index = network_of(lines_);
  const track::Route route({index->map().edge(17), true}, 0, 0);
  Shuttle train(index, 700);
  train.run(route, 2200);
  train.stand(72'000);
  EXPECT_NEAR(train.locator().way_m(), 1510, 30);
  train.run(route, 4200);
  expect_right(train.locator().locate(), route, 4200);
}

// On over a switch, back behind it, and on over its other leg, which runs beside the first one.
TEST_F(NetworkLocatorTest, WhatWasSetBackOverASwitchIsMeasuredAnewOnItsOtherLeg) {
  auto lines = lines_;
  const auto stem = static_cast<uint32_t>(lines.size() + 1);
  lines.push_back({{300, 0, 0}, {80, 0, 1 / 700.0}, {300, 1 / 700.0, 1 / 700.0}, {80, 1 / 700.0, 0}, {440, 0, 0}});
  const std::vector<track::Element> leg = {
      {300, 0, 0}, {80, 0, -1 / 500.0}, {200, -1 / 500.0, -1 / 500.0}, {80, -1 / 500.0, 0}, {900, 0, 0}};
  lines.push_back(leg);
  lines.push_back(leg);
  for (const double curvature : {-1 / 300.0, 1 / 300.0}) {
    lines.back().insert(lines.back().begin(), {35, curvature, curvature});
  }
  auto map = std::make_shared<track::Map>(network_of(lines)->map());
  const uint32_t node = map->edges[stem - 1].to_node;
  map->edges[stem].from_node = map->edges[stem + 1].from_node = node;
  map->nodes.push_back({node, track::NodeKind::railway_switch, "", 0, 0});
  map->connections = {{node, stem, stem + 1, false}, {node, stem, stem + 2, true}};
  const auto index = std::make_shared<const NetworkIndex>(map);
  track::Route first({map->edge(stem), true}, 0, 0);
  track::Route second = first;
  first.push_ahead({map->edge(stem + 1), true});
  second.push_ahead({map->edge(stem + 2), true});
  Shuttle train(index, 50);
  train.run(first, 1300);
  static_cast<void>(train.locator().locate());
  train.run(first, 1150);
  train.run(second, 2200);
  const auto location = train.locator().locate();
  ASSERT_FALSE(location.places.empty());
  EXPECT_EQ(location.places.front().place.edge, stem + 2) << to_string(location.doubt);
  EXPECT_GT(train.locator().way_m(), 2000) << "the way before the switch counts";
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

TEST_F(NetworkLocatorTest, WithoutACameraGyroAndSpeedLeadTheSearch) {
  constexpr double kFromM = 700;
  const auto map = std::make_shared<track::Map>(network_of(lines_)->map());
  const track::Route route({map->edge(17), true}, 0, 0);
  MapMatcher matcher({}, map);
  core::Random random(3);
  std::optional<PlaceFix> found;
  double at_m = kFromM;
  int64_t now_ns = core::kNsPerSecond;
  for (int state_no = 0; at_m < 4200 && !found; ++state_no) {
    const bool stands = state_no < 300;
    const double speed_mps = stands ? 0 : 25;
    for (int sample = 0; sample < 10; ++sample) {
      now_ns += core::to_ns(0.01);
      at_m += 0.01 * speed_mps;
      matcher.add(GyroInput{route.curvature_at(at_m) * speed_mps + 0.002 + 1e-4 * random.normal(), now_ns});
    }
    StateInput state;
    state.placed = {now_ns, {}, speed_mps, at_m - kFromM, 100, 100};
    state.track_known = false;
    state.standstill = stands;
    for (const PlaceFix& fix : matcher.add(state)) found = fix;
  }
  ASSERT_TRUE(found);
  EXPECT_EQ(found->kind, FixKind::network);
  EXPECT_EQ(found->options.front().place.edge, 17U);
  EXPECT_NEAR(found->options.front().place.offset_m, at_m, 4 * found->sigma_m);
}

// Of so many ways that lead to a place one may have been left out that fits better.
TEST_F(NetworkLocatorTest, MoreWaysAlikeThanAreFollowedAreSaid) {
  for (const uint32_t tracks : {10U, 40U}) {
    auto lines = lines_;
    const auto stem = static_cast<uint32_t>(lines.size() + 1);
    lines.push_back(lines_[16]);
    lines[16] = lines_[0];
    lines.resize(lines.size() + tracks, {{1000, 0, 0}});
    auto map = std::make_shared<track::Map>(network_of(lines)->map());
    const uint32_t node = map->edge(stem)->from_node;
    map->nodes.push_back({node, track::NodeKind::railway_switch, "", 0, 0});
    for (uint32_t id = stem + 1; id <= stem + tracks; ++id) {
      map->edges[id - 1].to_node = node;
      map->connections.push_back({node, id, stem, id != stem + 1});
    }
    const auto index = std::make_shared<const NetworkIndex>(map);
    track::Route route({map->edge(stem + 3), true}, 0, 0);
    route.push_ahead({map->edge(stem), true});
    Shuttle train(index, 500);
    train.run(route, 5000);
    const auto location = train.locator().locate();
    EXPECT_EQ(location.doubt, tracks > 24 ? Doubt::not_all_seen : Doubt::none) << tracks;
  }
}

TEST_F(NetworkLocatorTest, OnAMapThatIsDrawnRoughlyMoreMustSpeakForAPlace) {
  const auto index = network_of(lines_);
  const track::Route route({index->map().edge(17), true}, 0, 0);
  const auto wander = [&](double to_m, double by_rad) { return ride(index, route, 700, to_m, 0.01, 1e9, by_rad); };
  const auto early = wander(2000, 0.0102);
  const auto late = wander(5500, 0.0102);
  for (const auto& location : {early, late}) {
    ASSERT_FALSE(location.places.empty());
    EXPECT_EQ(location.places.front().place.edge, 17U);
    EXPECT_GT(location.places.front().misfit, 1.3);
    EXPECT_LT(location.places.front().misfit, 2);
  }
  EXPECT_EQ(early.doubt, Doubt::by_chance);
  EXPECT_TRUE(late.certain()) << to_string(late.doubt);
  EXPECT_EQ(wander(5500, 0.0145).doubt, Doubt::misfit);
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

TEST_F(NetworkLocatorTest, AskedOftenOrOnceGivesTheSame) {
  const auto index = network_of(lines_);
  const track::Route route({index->map().edge(17), true}, 0, 0);
  const auto once = ride(index, route, 700, 4200, 0.01);
  const auto often = ride(index, route, 700, 4200, 0.01, 250);
  ASSERT_FALSE(often.places.empty());
  EXPECT_TRUE(often.certain());
  EXPECT_EQ(often.places.front().place.edge, once.places.front().place.edge);
  EXPECT_NEAR(often.places.front().place.offset_m, once.places.front().place.offset_m, 0.5);
}

// With some rolling back where a block of the way is just whole. The least times of several rides are compared: what
// else the machine does counts for processor time, too.
TEST_F(NetworkLocatorTest, WhatIsPreparedOnTheWayGivesTheSameAndLessIsLeftToDo) {
  constexpr int kRides = 5;
  const auto index = network_of(lines_);
  const track::Route route({index->map().edge(17), true}, 0, 0);
  const auto last_search = [&](bool prepares) {
    Location location;
    std::clock_t least = std::numeric_limits<std::clock_t>::max();
    for (int i = 0; i < kRides; ++i) {
      Shuttle train(index, 700);
      train.prepares = prepares;
      for (const double to_m : {1395.0, 1391.0, 2089.0, 2083.0, 4200.0}) train.run(route, to_m);
      const std::clock_t begin = std::clock();
      location = train.locator().locate();
      least = std::min(least, std::clock() - begin);
    }
    return std::pair(location, least);
  };
  const auto [once, whole] = last_search(false);
  const auto [prepared, rest] = last_search(true);
  expect_right(prepared, route, 4200);
  EXPECT_NEAR(prepared.places.front().place.offset_m, once.places.front().place.offset_m, 0.5);
  EXPECT_LT(rest, whole);
}

TEST_F(NetworkLocatorTest, NotAskedForLongerThanTheWayItRemembersItFindsThePlaceNonetheless) {
  auto& line = lines_[16];
  for (const size_t other : {3U, 9U}) line.insert(line.end(), lines_[other].begin(), lines_[other].end());
  lines_[3] = lines_[9] = lines_[0];
  const auto index = network_of(lines_);
  const track::Route route({index->map().edge(17), true}, 0, 0);
  Shuttle train(index, 700);
  train.run(route, 2300);
  static_cast<void>(train.locator().locate());
  train.run(route, 11'000);
  static_cast<void>(train.locator().locate());
  train.run(route, 14'000);
  expect_right(train.locator().locate(), route, 14'000);
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

TEST_F(NetworkLocatorTest, NineHundredMetresAreNotEnoughToBeCertain) {
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
