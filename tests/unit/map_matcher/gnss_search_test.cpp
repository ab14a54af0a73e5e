// Where GNSS alone says where the train is, and where it cannot.
#include "map_matcher/locate/gnss_search.hpp"

#include <gtest/gtest.h>

#include <chrono>
#include <cmath>

#include "core/random.hpp"
#include "core/units.hpp"
#include "fork_map.hpp"
#include "fusion/fusion_parameters.hpp"

namespace railfix::map_matcher::gnss_search_test {
namespace {

constexpr double kSpeedMps = 15;

/// A train on the straight track of a map northwards, seen once a second from `from_m` on.
class Ride {
 public:
  explicit Ride(std::shared_ptr<const track::Map> map, GnssSearchParameters parameters = {})
      : search_(parameters, std::make_shared<const NetworkIndex>(std::move(map))) {}

  /// Its camera looks north; with a negative speed it backs. What GNSS errs by at a time.
  template <typename Error>
  void run(double from_m, double to_m, const Error& east_and_north_m) {
    const double sign = to_m > from_m ? 1 : -1;
    for (double m = from_m; sign * (to_m - m) > -1e-9; m += sign * kSpeedMps) {
      const auto [east_m, north_m] = east_and_north_m(m);
      search_.add({east_m, m + north_m, hdop}, m, kSpeedMps);
      const auto found = search_.place();
      place_ = found ? std::optional(found->place) : std::nullopt;
      sigma_m_ = found ? found->sigma_m : 0;
    }
  }
  void run(double from_m, double to_m) {
    run(from_m, to_m, [](double) { return std::pair{2.0, -3.0}; });
  }

  [[nodiscard]] const std::optional<track::EdgePosition>& place() const { return place_; }
  [[nodiscard]] double sigma_m() const { return sigma_m_; }
  [[nodiscard]] std::optional<size_t> tracks() const { return search_.tracks(); }

  double hdop = 1;

 private:
  GnssSearch search_;
  std::optional<track::EdgePosition> place_;
  double sigma_m_ = 0;
};

std::shared_ptr<track::Map> tracks_at(const std::vector<double>& eastings_m) {
  auto map = std::make_shared<track::Map>();
  for (const double east_m : eastings_m) {
    const auto id = static_cast<uint32_t>(map->edges.size() + 1);
    map->edges.push_back({id, "", 2 * id - 1, 2 * id, "", track::Alignment::chained({east_m, 0, 0}, {{3000, 0, 0}})});
    map->nodes.push_back({2 * id - 1, track::NodeKind::end, "", east_m, 0});
    map->nodes.push_back({2 * id, track::NodeKind::end, "", east_m, 3000});
  }
  return map;
}

TEST(GnssSearch, FindsTheOneTrackAndTheWayThatTheTrainLooks) {
  Ride ahead(tracks_at({0}));
  ahead.run(300, 420);
  EXPECT_FALSE(ahead.place()) << "it has not agreed with the odometer for long";
  ahead.run(435, 600);
  ASSERT_TRUE(ahead.place());
  EXPECT_EQ(ahead.place()->edge, 1U);
  EXPECT_NEAR(ahead.place()->offset_m, 597, 1e-6);
  EXPECT_EQ(ahead.place()->direction, track::Direction::forward);
  EXPECT_EQ(ahead.tracks(), 1U);

  Ride back(tracks_at({0}));
  back.run(900, 600);
  ASSERT_TRUE(back.place());
  EXPECT_EQ(back.place()->direction, track::Direction::forward) << "its front still looks north";
}

// Every metre or more often: positions that are near each other must not take each other's place for ever.
TEST(GnssSearch, FindsASlowTrainWithAFastReceiver) {
  for (const double step_m : {0.01, 0.3, 0.5, 0.8, 0.99, 1.01, 2.0, 8.0}) {
    GnssSearch search({}, std::make_shared<const NetworkIndex>(tracks_at({0})));
    double way_m = 0;
    for (; way_m < 500 && !search.place(); way_m += step_m) search.add({2, 300 + way_m, 1}, way_m, 10 * step_m);
    EXPECT_LT(way_m, 115) << step_m;
  }
}

TEST(GnssSearch, CannotTellTracksThatLieBesideEachOther) {
  for (const double beside_m : {4.5, 12.0, 25.0}) {
    Ride ride(tracks_at({0, beside_m}));
    ride.run(300, 2400);
    EXPECT_FALSE(ride.place()) << beside_m;
    EXPECT_EQ(ride.tracks(), 2U) << beside_m;
  }
  Ride far(tracks_at({0, 40}));
  far.run(300, 600);
  ASSERT_TRUE(far.place());
  EXPECT_EQ(far.place()->edge, 1U);
}

TEST(GnssSearch, WaitsBehindASwitchUntilTheLegsAreFarApart) {
  Ride ride(fork());  // at 500 m; the left leg leaves at 7 degrees
  ride.run(200, 470);
  ASSERT_TRUE(ride.place());
  EXPECT_EQ(ride.place()->edge, 1U);
  ride.run(485, 700);
  EXPECT_FALSE(ride.place());
  ride.run(715, 985);
  ASSERT_TRUE(ride.place());
  EXPECT_EQ(ride.place()->edge, 2U);
}

TEST(GnssSearch, BelievesNoneThatMovesOtherwiseThanTheOdometer) {
  const auto map = tracks_at({0});
  Ride stuck(map);
  stuck.run(300, 1500, [](double m) { return std::pair{0.0, 300 - m}; });
  EXPECT_FALSE(stuck.place());
  Ride jumping(map);
  jumping.run(300, 1500, [](double m) { return std::pair{0.0, std::fmod(m, 90) < 15 ? 60.0 : 0.0}; });
  EXPECT_FALSE(jumping.place());
  Ride to_and_fro(map);
  for (int i = 0; i < 10; ++i) {
    to_and_fro.run(300, 360);
    to_and_fro.run(360, 300);
  }
  EXPECT_FALSE(to_and_fro.place());
}

TEST(GnssSearch, SaysNothingWhereTheMapHasNoTrackThatGoesThere) {
  Ride beside(tracks_at({200}));
  beside.run(300, 900);
  EXPECT_FALSE(beside.place());
  EXPECT_EQ(beside.tracks(), 0U);
  Ride beyond(tracks_at({0}));
  beyond.run(2980, 3400);
  EXPECT_FALSE(beyond.place());
}

TEST(GnssSearch, ItsSigmaHoldsWhatFusionAllowsForAndVagueFixesSayNothing) {
  const auto map = tracks_at({0});
  const fusion::FusionParameters fusion;
  const double late_m = fusion.gnss_lag_s * kSpeedMps;
  Ride ride(map);
  ride.run(300, 900);
  ASSERT_TRUE(ride.place());
  EXPECT_NEAR(fusion.interval_factor * ride.sigma_m(), fusion.gnss_bound_m + late_m, 1e-9);
  ride.hdop = 3;
  ride.run(915, 1200);
  ASSERT_TRUE(ride.place());
  EXPECT_NEAR(fusion.interval_factor * ride.sigma_m(),
              fusion.interval_factor * fusion.gnss_single_sigma_m * ride.hdop + late_m, 1e-9);
  Ride vague(map);
  vague.hdop = 3.1;
  vague.run(300, 900);
  EXPECT_FALSE(vague.place());
}

TEST(GnssSearch, SaysWhereTheFootIsNotTheAntenna) {
  Ride ride(tracks_at({0}), {.antenna_ahead_m = -60});
  ride.run(300, 900, [](double) { return std::pair{0.0, 0.0}; });
  ASSERT_TRUE(ride.place());
  EXPECT_NEAR(ride.place()->offset_m, 960, 1e-6);
  Ride ahead(tracks_at({0}), {.antenna_ahead_m = 20});
  ahead.run(300, 900, [](double) { return std::pair{0.0, 0.0}; });
  EXPECT_NEAR(ahead.place()->offset_m, 880, 1e-6);
}

// Where a finder's foot is only rough: real maps have short elements, and here every place of a bend is asked for.
TEST(GnssSearch, SeesBothTracksInEveryPlaceOfABend) {
  const auto map = std::make_shared<track::Map>();
  const std::vector<track::Element> bend(50, {20, 1.0 / 290, 1.0 / 290});
  map->edges.push_back({1, "", 1, 2, "", track::Alignment::chained({0, 0, 0}, bend)});
  map->edges.push_back({2, "", 3, 4, "", track::Alignment::chained({6, 0, 0}, bend)});
  map->nodes = {{1, track::NodeKind::end, "", 0, 0},
                {2, track::NodeKind::end, "", 0, 0},
                {3, track::NodeKind::end, "", 6, 0},
                {4, track::NodeKind::end, "", 0, 0}};
  map->connections = {};
  const auto index = std::make_shared<const NetworkIndex>(map);
  for (double first_m = 20; first_m < 40; first_m += 0.7) {
    GnssSearch search({}, index);
    for (double m = first_m; m < 600; m += 15 + first_m / 4) {
      const auto pose = map->edge(1)->alignment.at(m).pose;
      search.add({pose.easting_m, pose.northing_m, 1}, m, kSpeedMps);
      ASSERT_FALSE(search.place()) << m;
      if (search.tracks()) {
        ASSERT_EQ(search.tracks(), 2U) << m;
      }
    }
  }
}

// A balloon loop drawn as one edge: two straights 10 m apart.
TEST(GnssSearch, CannotTellTheLegsOfOneEdgeThatComesBack) {
  auto map = std::make_shared<track::Map>();
  map->edges.push_back(
      {1, "", 1, 2, "", track::Alignment::chained({0, 0, 0}, {{1000, 0, 0}, {core::kPi * 5, 0.2, 0.2}, {1000, 0, 0}})});
  map->nodes = {{1, track::NodeKind::end, "", 0, 0}, {2, track::NodeKind::end, "", -10, 0}};
  Ride ride(map);
  ride.run(300, 900);
  EXPECT_FALSE(ride.place());
}

// Joints every metre are none between tracks; a stub that ends just behind the train may be where it is.
TEST(GnssSearch, GoesOverJointsAndMindsTracksThatEnd) {
  auto jointed = std::make_shared<track::Map>();
  for (uint32_t id = 1; id <= 900; ++id) {
    jointed->edges.push_back({id, "", id, id + 1, "", track::Alignment::chained({0, id - 1.0, 0}, {{1, 0, 0}})});
    if (id > 1) jointed->connections.push_back({id, id - 1, id, false});
  }
  Ride over(jointed);
  over.run(300, 600);
  ASSERT_TRUE(over.place());
  EXPECT_EQ(over.tracks(), 1U);

  auto stub = tracks_at({0, 12});
  stub->edges[1].alignment = track::Alignment::chained({12, 0, 0}, {{690, 0, 0}});
  Ride ride(stub);
  ride.run(300, 705);
  EXPECT_FALSE(ride.place()) << "it may stand on the stub";
  ride.run(720, 1000);
  EXPECT_TRUE(ride.place());
}

TEST(GnssSearch, KeepsNothingOfATrainThatStands) {
  GnssSearch search({}, std::make_shared<const NetworkIndex>(tracks_at({0, 5})));
  double m = 300;
  for (; m < 600; m += 15) search.add({0, m, 1}, m, kSpeedMps);
  EXPECT_EQ(search.tracks(), 2U);
  const auto begin = std::chrono::steady_clock::now();
  for (int i = 0; i < 500'000; ++i) search.add({0, m, 1}, m, 0);
  for (int i = 0; i < 1000; ++i) (void)search.place();
  EXPECT_LT(std::chrono::steady_clock::now() - begin, std::chrono::seconds(2)) << "2 ms a call where all are kept";
}

// Single fixes as receivers give them, 1,000 rides; where one is wrong is no matter of chance.
TEST(GnssSearch, HoldsTheTrainWithinFourSigma) {
  core::Random random(7);
  size_t found = 0;
  for (int ride = 0; ride < 1000; ++ride) {
    const double lasting_east_m = 3 * random.normal();
    const double lasting_north_m = 3 * random.normal();
    Ride one(tracks_at({0, 35}));
    one.run(300, 900, [&](double) {
      return std::pair{lasting_east_m + random.normal(), lasting_north_m + random.normal()};
    });
    if (!one.place()) continue;
    ++found;
    EXPECT_EQ(one.place()->edge, 1U);
    EXPECT_NEAR(one.place()->offset_m, 900, 4 * one.sigma_m());
  }
  EXPECT_GT(found, 700U);
}

}  // namespace
}  // namespace railfix::map_matcher::gnss_search_test
