// Where on the network, without a prior: trains that start anywhere on a map, in either direction, with an odometer
// that is wrong by up to 2 %.
#include <algorithm>
#include <array>
#include <cstdio>
#include <ctime>
#include <iostream>

#include "core/units.hpp"
#include "map_matcher/map_matcher_config.hpp"
#include "matching.hpp"
#include "support/sensed_ride.hpp"
#include "track/import/build.hpp"
#include "track/import/made_network.hpp"

namespace railfix::measure {
namespace {

constexpr double kTripM = 5000;
constexpr double kRightM = 50;
constexpr double kMissed = 0.15;    // landmarks that are not sighted
constexpr double kMapSigmaM = 1.0;  // ... and are so far from where the map has them
constexpr double kFalsePerM = 0.0003;
constexpr std::array kFalseKinds{track::LandmarkKind::balise, track::LandmarkKind::frog, track::LandmarkKind::bridge,
                                 track::LandmarkKind::platform, track::LandmarkKind::portal_in};

double processor_s() {
  return static_cast<double>(std::clock()) / CLOCKS_PER_SEC;
}

std::shared_ptr<const track::Map> made_map(double track_km, uint64_t seed) {
  return std::make_shared<const track::Map>(track::made_network({.track_km = track_km, .seed = seed}));
}

std::shared_ptr<const track::Map> map_of(const MatchingOptions& options) {
  if (options.map.empty()) return made_map(options.track_km, options.seed);
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
  std::vector<double> searches_s;
  std::vector<map_matcher::Doubt> doubts;
  double turn_rad = 0;        // of the true track, over stretches of 20 m
  double most_sigmas = 0;     // error of a place that was certain
  double bound_m = INFINITY;  // least error that could be had on the way
};

/// What the locator knows, and where the train really is: mostly the same.
struct Networks {
  std::shared_ptr<const map_matcher::NetworkIndex> known;
  std::shared_ptr<const map_matcher::NetworkIndex> real;
};

double apart_m(const Networks& networks, const track::EdgePosition& place, const track::EdgePosition& truth) {
  if (networks.known != networks.real) return INFINITY;
  const auto& map = networks.real->map();
  const auto p = map.edge(place.edge)->alignment.at(place.offset_m).pose;
  const auto q = map.edge(truth.edge)->alignment.at(truth.offset_m).pose;
  return std::hypot(p.easting_m - q.easting_m, p.northing_m - q.northing_m);
}

/// The real track wanders about the mapped one: its curvature, less the map's.
class MapError {
 public:
  MapError(double sigma_m, core::Random& random) {
    for (auto& wave : waves_) {
      wave = {random.normal() / kLengthM, random.uniform(0, 6.283)};
      wave.amplitude_m = sigma_m * std::sqrt(2.0 / static_cast<double>(waves_.size()));
    }
  }
  [[nodiscard]] double curvature_at(double m) const {
    double sum = 0;
    for (const auto& w : waves_) sum -= w.amplitude_m * w.per_m * w.per_m * std::sin(w.per_m * m + w.phase);
    return sum;
  }

 private:
  static constexpr double kLengthM = 60;
  struct Wave {
    double per_m = 0;
    double phase = 0;
    double amplitude_m = 0;
  };
  std::array<Wave, 24> waves_;
};

/// How well the place can be known at all: the Cramer-Rao bound of place and scale with the locator's own noise.
double bound_m(const testing::VehicleHeading& heading, double begin_m, double end_m, double step_noise_rad) {
  const map_matcher::LocatorParameters p;
  const double bin_m = map_matcher::kBinM;
  const auto curvature = [&](double m) { return (heading.at(m + 5) - heading.at(m - 5)) / 10; };
  double place = 0;
  double both = 0;
  double scale = 3 / (p.scale_range * p.scale_range);
  for (double m = begin_m; m + bin_m <= end_m; m += bin_m) {
    const double turn = heading.at(m + bin_m) - heading.at(m);
    const double variance = 2 * std::pow(p.heading_sigma_rad, 2) * 0.4 + std::pow(p.curvature_share * turn, 2) +
                            bin_m * step_noise_rad * step_noise_rad;
    const double by_place = curvature(m + bin_m) - curvature(m);
    const double by_scale = curvature(m) * (end_m - m) - curvature(m + bin_m) * (end_m - m - bin_m);
    const double weight = 1 / (variance * p.correlated_bins);
    place += weight * by_place * by_place;
    both += weight * by_place * by_scale;
    scale += weight * by_scale * by_scale;
  }
  const double det = place * scale - both * both;
  return det > 0 ? std::sqrt(scale / det) : INFINITY;
}

Trip run_trip(const Networks& networks, const track::Route& route, const MatchingOptions& options,
              core::Random& random) {
  testing::RideErrors errors;
  errors.odometer_scale = random.uniform(-0.02, 0.02);
  errors.turn_bias_rps = 0.001 * random.normal();
  errors.turn_noise_rps = 0;
  errors.step_turn_noise_rad = 3e-4;
  const double first_m = route.begin_m() + 1;
  const MapError wander(options.map_error_m, random);
  const testing::VehicleHeading mapped([&](double m) { return route.curvature_at(m); }, first_m, first_m + kTripM + 50,
                                       errors);
  const testing::VehicleHeading heading([&](double m) { return route.curvature_at(m) + wander.curvature_at(m); },
                                        first_m, first_m + kTripM + 50, errors);
  testing::RideSensors sensors(errors, random.next());
  map_matcher::NetworkLocator locator({}, networks.known);
  Trip trip;
  double looked_m = 0;
  const double every_m = map_matcher::MapMatcherConfig{}.locate_every_m;
  constexpr double kStepM = 1.0;
  for (double m = first_m; m < first_m + kTripM; m += 20) {
    trip.turn_rad += std::abs(mapped.at(m + 20) - mapped.at(m));
  }
  for (double at_m = 0; at_m < kTripM; at_m += kStepM) {
    const auto s = sensors.step(heading, 0, first_m + at_m, first_m + at_m + kStepM, kStepM / 20);
    locator.move(s.way_m, s.turn_rad, s.turn_sigma_rad);
    const double here_m = first_m + at_m + kStepM;
    const auto& leg = route.leg_at(here_m + 8);
    for (const auto& mark : networks.real->marks_on(leg.run)) {
      const double mark_m = leg.begin_m + mark.along_m;
      if (mark_m <= here_m + 8 - kStepM || mark_m > here_m + 8 || random.uniform() < kMissed) continue;
      locator.sight({0, mark.kind, mark_m - here_m + kMapSigmaM * random.normal(), mark.lateral_m, 0.2, 0.95});
    }
    if (random.uniform() < kFalsePerM * kStepM) {
      const auto kind = kFalseKinds[static_cast<size_t>(random.uniform(0, static_cast<double>(kFalseKinds.size())))];
      const double side = random.uniform() < 0.5 ? -1 : 1;
      locator.sight({0, kind, 8, kind == track::LandmarkKind::frog ? 0.72 * side : 0, 0.2, 0.95});
    }
    const bool last = at_m + 1.5 * kStepM > kTripM;
    if (!last && at_m - looked_m < every_m) continue;
    looked_m = at_m;
    trip.bound_m = std::min(trip.bound_m, bound_m(mapped, first_m, here_m, errors.step_turn_noise_rad));
    const double begin_s = processor_s();
    const auto location = locator.locate();
    trip.searches_s.push_back(processor_s() - begin_s);
    if (location.places.empty()) continue;
    const auto truth = route.position_at(here_m);
    const auto& best = location.places.front().place;
    const bool near = apart_m(networks, best, truth) < kRightM;
    // Near a joint of edges the place may lie on the next one: on the route it must be.
    const auto on_route = route.distance_of(best, here_m);
    const bool right = near && on_route && std::abs(*on_route - here_m) < kRightM;
    if (location.certain() && !trip.found) {
      trip.found = true;
      trip.found_after_m = at_m;
    }
    if (location.place_certain() && !trip.place_found) {
      trip.place_found = true;
      trip.place_after_m = at_m;
    }
    trip.doubts.push_back(location.doubt);
    const double sigmas = apart_m(networks, best, truth) / location.places.front().sigma_m;
    if (location.certain()) trip.most_sigmas = std::max(trip.most_sigmas, sigmas);
    if ((location.certain() && (!right || sigmas > 4)) || (location.place_certain() && !near)) trip.wrong = true;
    trip.best_right = near;
    if (options.each && ((location.certain() && !right) || (location.place_certain() && !near))) {
      std::printf("  wrong at %.0f m: %u:%.0f for %u:%.0f, %.0f m apart, sigma %.0f m, misfit %.2f\n", at_m, best.edge,
                  best.offset_m, truth.edge, truth.offset_m, apart_m(networks, best, truth),
                  location.places.front().sigma_m, location.places.front().misfit);
    }
  }
  return trip;
}

void print_found(const char* what, const std::vector<Trip>& trips) {
  const auto share = [&](auto property) {
    return 100.0 * static_cast<double>(std::count_if(trips.begin(), trips.end(), property)) /
           static_cast<double>(std::max<size_t>(trips.size(), 1));
  };
  std::printf("%-28s %4zu: best place right at the end %5.1f %%, place certain %5.1f %%, track certain %5.1f %%\n",
              what, trips.size(), share([](const Trip& t) { return t.best_right; }),
              share([](const Trip& t) { return t.place_found; }), share([](const Trip& t) { return t.found; }));
}

double quantile(const std::vector<double>& sorted, double share) {
  return sorted.empty() ? 0.0 : sorted[static_cast<size_t>(share * static_cast<double>(sorted.size() - 1))];
}

void print(const std::vector<Trip>& trips) {
  print_found("trips of 5 km", trips);
  std::vector<Trip> informed;
  std::copy_if(trips.begin(), trips.end(), std::back_inserter(informed),
               [](const Trip& t) { return t.bound_m < map_matcher::LocatorParameters{}.certain_sigma_m; });
  print_found("... where the track can tell", informed);
  std::vector<double> seconds;
  std::vector<double> after_m;
  double most_sigmas = 0;
  int wrong = 0;
  for (const Trip& t : trips) {
    seconds.insert(seconds.end(), t.searches_s.begin(), t.searches_s.end());
    if (t.found) after_m.push_back(t.found_after_m);
    most_sigmas = std::max(most_sigmas, t.most_sigmas);
    wrong += t.wrong ? 1 : 0;
  }
  std::sort(seconds.begin(), seconds.end());
  std::sort(after_m.begin(), after_m.end());
  std::printf(
      "wrong although certain %d; largest error of a certain place %.1f sigma; track certain after %.0f m in the "
      "median\n",
      wrong, most_sigmas, quantile(after_m, 0.5));
  std::printf("search (processor time, %zu): p50 %.2f, p99 %.2f, max %.2f s\n", seconds.size(), quantile(seconds, 0.5),
              quantile(seconds, 0.99), quantile(seconds, 1));
}

void tell(int number, const Trip& t) {
  const double slowest_s = t.searches_s.empty() ? 0.0 : *std::max_element(t.searches_s.begin(), t.searches_s.end());
  std::printf("%4d: %s%s", number, t.wrong ? "WRONG, " : "", t.best_right ? "" : "not found, ");
  if (t.found) {
    std::printf("track certain after %.0f m", t.found_after_m);
  } else if (t.place_found) {
    std::printf("place certain after %.0f m", t.place_after_m);
  } else {
    std::printf("not certain: %s", t.doubts.empty() ? "bends too little" : to_string(t.doubts.back()).c_str());
  }
  std::printf("; turned %.2f rad, bound %.0f m, slowest search %.2f s\n", t.turn_rad, t.bound_m, slowest_s);
  std::fflush(stdout);
}

/// Trips are drawn each for itself, so that a run may begin anywhere among them.
std::optional<Trip> trip_of(int number, const Networks& networks, const MatchingOptions& options) {
  core::Random random(options.seed * 7919 + 5 + 1000003 * static_cast<uint64_t>(number));
  for (int tries = 0; tries < 100; ++tries) {
    if (const auto route = random_route(networks.real->map(), networks.real->ways(), random)) {
      return run_trip(networks, *route, options, random);
    }
  }
  return std::nullopt;
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
  auto real = index;
  if (options.elsewhere > 0) {
    real = std::make_shared<const map_matcher::NetworkIndex>(made_map(options.track_km, options.elsewhere));
  }
  const int count = options.count > 0 ? options.count : 100;
  std::vector<Trip> trips;
  for (int i = options.from; i < options.from + count; ++i) {
    const auto trip = trip_of(i, {index, real}, options);
    if (!trip) continue;
    trips.push_back(*trip);
    if (options.each) tell(i, trips.back());
  }
  print(trips);
  return 0;
}

}  // namespace railfix::measure
