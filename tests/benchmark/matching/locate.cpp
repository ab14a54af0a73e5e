// Where on the network, without a prior: trains that start anywhere on a map, in either direction, with an odometer
// that is wrong by up to 2 %.
#include <algorithm>
#include <cstdio>
#include <ctime>
#include <iostream>

#include "core/units.hpp"
#include "map_matcher/network_locator.hpp"
#include "matching.hpp"
#include "support/sensed_ride.hpp"
#include "track/import/build.hpp"
#include "track/import/made_network.hpp"

namespace railfix::measure {
namespace {

constexpr double kTripM = 5000;
constexpr double kEveryM = 250;
constexpr double kRightM = 50;

double processor_s() {
  return static_cast<double>(std::clock()) / CLOCKS_PER_SEC;
}

std::shared_ptr<const track::Map> map_of(const MatchingOptions& options) {
  if (options.map.empty()) {
    return std::make_shared<const track::Map>(
        track::made_network({.track_km = options.track_km, .seed = options.seed}));
  }
  auto loaded = track::Map::load(options.map);
  if (loaded.ok()) return std::make_shared<const track::Map>(std::move(loaded).value());
  return std::make_shared<const track::Map>(core::value_or_throw(track::build_map({options.map}, {})).map);
}

/// A way that takes any leg of a switch (the straight one more often), long enough; nothing where the track ends.
std::optional<track::Route> random_route(const track::Map& map, const track::Ways& ways, core::Random& random) {
  const auto& edge = map.edges[static_cast<size_t>(random.uniform(0, static_cast<double>(map.edges.size())))];
  track::Route route({&edge, random.uniform() < 0.5}, 0, 0);
  if (!route.legs().front().run.forward) route = track::Route(route.legs().front().run, edge.alignment.length_m(), 0);
  const double start_m = random.uniform(0, edge.alignment.length_m());
  while (route.end_m() < start_m + kTripM + 200) {
    const auto& next = ways.after(route.legs().back().run);
    if (next.empty() || route.legs().size() > 2000) return std::nullopt;
    const bool turn = next.size() > 1 && random.uniform() < 0.15;
    route.push_ahead(next[turn ? 1 : 0]);
  }
  return route;
}

struct Trip {
  bool found = false;        // the track was certain ...
  bool place_found = false;  // ... or the place, tracks beside each other still open
  bool wrong = false;
  double found_after_m = 0;
  double place_after_m = 0;
  bool best_right = false;  // at the end, certain or not
  double slowest_s = 0;
  double turn_rad = 0;
};

double apart_m(const track::Map& map, const track::EdgePosition& a, const track::EdgePosition& b) {
  const auto p = map.edge(a.edge)->alignment.at(a.offset_m).pose;
  const auto q = map.edge(b.edge)->alignment.at(b.offset_m).pose;
  return std::hypot(p.easting_m - q.easting_m, p.northing_m - q.northing_m);
}

Trip run_trip(const std::shared_ptr<const map_matcher::NetworkIndex>& index, const track::Route& route,
              core::Random& random) {
  testing::RideErrors errors;
  errors.odometer_scale = random.uniform(-0.02, 0.02);
  errors.turn_bias_rps = 0;
  errors.turn_noise_rps = 0;
  errors.step_turn_noise_rad = 3e-4;
  const double first_m = route.begin_m() + 1;
  const testing::VehicleHeading heading([&](double m) { return route.curvature_at(m); }, first_m, first_m + kTripM + 50,
                                        errors);
  testing::RideSensors sensors(errors, random.next());
  map_matcher::NetworkLocator locator({}, index);
  Trip trip;
  double looked_m = 0;
  constexpr double kStepM = 1.0;
  for (double at_m = 0; at_m < kTripM; at_m += kStepM) {
    const auto s = sensors.step(heading, 0, first_m + at_m, first_m + at_m + kStepM, kStepM / 20);
    trip.turn_rad += std::abs(s.turn_rad);
    locator.move(s.way_m, s.turn_rad, s.turn_sigma_rad);
    const double here_m = first_m + at_m + kStepM;
    const auto& leg = route.leg_at(here_m + 8);
    for (const auto* balise : index->balises_on(*leg.run.edge)) {
      const double balise_m =
          leg.begin_m + (leg.run.forward ? balise->offset_m : leg.run.length_m() - balise->offset_m);
      if (balise_m <= here_m + 8 - kStepM || balise_m > here_m + 8 || random.uniform() < 0.15) continue;
      locator.sight({0, track::LandmarkKind::balise, balise_m - here_m, 0, 0.2, 0.95});
    }
    if (random.uniform() < 0.0003 * kStepM) locator.sight({0, track::LandmarkKind::balise, 8, 0, 0.2, 0.95});
    const bool last = at_m + 1.5 * kStepM > kTripM;
    if (!last && at_m - looked_m < kEveryM) continue;
    looked_m = at_m;
    const double begin_s = processor_s();
    const auto location = locator.locate();
    trip.slowest_s = std::max(trip.slowest_s, processor_s() - begin_s);
    if (location.places.empty()) continue;
    const auto truth = route.position_at(here_m);
    const auto& best = location.places.front().place;
    const bool near = apart_m(index->map(), truth, best) < kRightM;
    // Near a joint of edges the place may lie on the next one: on the route it must be.
    const auto on_route = route.distance_of(best, here_m);
    const bool right = near && on_route && std::abs(*on_route - here_m) < kRightM;
    if (location.certain && !trip.found) {
      trip.found = true;
      trip.found_after_m = at_m;
    }
    if (location.place_certain && !trip.place_found) {
      trip.place_found = true;
      trip.place_after_m = at_m;
    }
    if ((location.certain && !right) || (location.place_certain && !near)) trip.wrong = true;
    trip.best_right = near;
  }
  return trip;
}

}  // namespace

int measure_locate(const MatchingOptions& options) {
  const auto map = map_of(options);
  double track_m = 0;
  for (const auto& edge : map->edges) track_m += edge.alignment.length_m();
  const double begin_s = processor_s();
  const auto index = std::make_shared<const map_matcher::NetworkIndex>(map);
  std::printf("%.0f km of track, %zu edges, index made in %.2f s\n", track_m / 1000, map->edges.size(),
              processor_s() - begin_s);
  core::Random random(options.seed * 7919 + 5);
  const int count = options.count > 0 ? options.count : 100;
  std::vector<Trip> trips;
  int tries = 0;
  while (static_cast<int>(trips.size()) < count && ++tries < 100 * count) {
    const auto route = random_route(*map, index->ways(), random);
    if (!route) continue;
    trips.push_back(run_trip(index, *route, random));
    if (options.each) {
      const Trip& t = trips.back();
      std::printf("%s%s place after %.0f m, track after %.0f m, turned %.2f rad, %.2f s\n", t.wrong ? "WRONG " : "",
                  t.best_right ? "" : "not found", t.place_after_m, t.found_after_m, t.turn_rad, t.slowest_s);
    }
  }
  const auto share = [&](auto what) {
    return 100.0 * static_cast<double>(std::count_if(trips.begin(), trips.end(), what)) /
           static_cast<double>(std::max<size_t>(trips.size(), 1));
  };
  std::vector<double> seconds;
  for (const Trip& t : trips) seconds.push_back(t.slowest_s);
  std::sort(seconds.begin(), seconds.end());
  std::printf("trips of 5 km: %zu; best place right at the end %.1f %%, place certain %.1f %%, track certain %.1f %%\n",
              trips.size(), share([](const Trip& t) { return t.best_right; }),
              share([](const Trip& t) { return t.place_found; }), share([](const Trip& t) { return t.found; }));
  std::printf("wrong although certain: %d; slowest search of a trip (processor time): median %.2f s, max %.2f s\n",
              static_cast<int>(std::count_if(trips.begin(), trips.end(), [](const Trip& t) { return t.wrong; })),
              seconds.empty() ? 0.0 : seconds[seconds.size() / 2], seconds.empty() ? 0.0 : seconds.back());
  return 0;
}

}  // namespace railfix::measure
