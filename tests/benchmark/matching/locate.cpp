// Where on the network, without a prior: trains that start anywhere on a map, in either direction, with an odometer
// that is wrong by up to 2 %.
#include <algorithm>
#include <cstdio>
#include <iostream>

#include "locate_trip.hpp"
#include "matching.hpp"
#include "track/import/build.hpp"
#include "track/import/made/made_network.hpp"

namespace railfix::measure {
namespace {

std::shared_ptr<const track::Map> made_map(double track_km, uint64_t seed) {
  return std::make_shared<const track::Map>(track::made_network({.track_km = track_km, .seed = seed}));
}

std::shared_ptr<const track::Map> map_of(const MatchingOptions& options) {
  if (options.map.empty()) return made_map(options.track_km, options.seed);
  auto loaded = track::Map::load(options.map);
  if (loaded.ok()) return std::make_shared<const track::Map>(std::move(loaded).value());
  return std::make_shared<const track::Map>(core::value_or_throw(track::build_map({options.map}, {})).map);
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

void print_gnss(const std::vector<Trip>& trips) {
  std::vector<double> after_m;
  for (const Trip& t : trips) {
    if (t.by_gnss_after_m) after_m.push_back(*t.by_gnss_after_m);
  }
  if (after_m.empty()) return;
  std::sort(after_m.begin(), after_m.end());
  const auto either = std::ranges::count_if(trips, [](const Trip& t) { return t.found || t.by_gnss_after_m; });
  std::printf("by GNSS alone: %zu, after %.0f m in the median, 90 %% within %.0f m; wrong %zu; either way %zu\n",
              after_m.size(), quantile(after_m, 0.5), quantile(after_m, 0.9),
              static_cast<size_t>(std::ranges::count_if(trips, &Trip::gnss_wrong)), static_cast<size_t>(either));
}

void print(const std::vector<Trip>& trips) {
  print_found("trips", trips);
  std::vector<Trip> informed;
  std::copy_if(trips.begin(), trips.end(), std::back_inserter(informed),
               [](const Trip& t) { return t.bound_m < map_matcher::LocatorParameters{}.certain_sigma_m; });
  print_found("... where the track can tell", informed);
  std::vector<double> seconds;
  std::vector<double> answers;
  std::vector<double> after_m;
  double prepared_s = 0;
  double most_sigmas = 0;
  int wrong = 0;
  for (const Trip& t : trips) {
    seconds.insert(seconds.end(), t.searches_s.begin(), t.searches_s.end());
    answers.insert(answers.end(), t.answers_s.begin(), t.answers_s.end());
    prepared_s = std::max(prepared_s, t.most_prepared_s);
    if (t.found) after_m.push_back(t.found_after_m);
    most_sigmas = std::max(most_sigmas, t.most_sigmas);
    wrong += t.wrong ? 1 : 0;
  }
  std::sort(seconds.begin(), seconds.end());
  std::sort(answers.begin(), answers.end());
  std::sort(after_m.begin(), after_m.end());
  std::printf(
      "wrong although certain %d; largest error of a certain place %.1f sigma; track certain after %.0f m in the "
      "median\n",
      wrong, most_sigmas, quantile(after_m, 0.5));
  print_gnss(trips);
  std::printf("search (processor time, %zu): p50 %.2f, p99 %.2f, max %.2f s\n", seconds.size(), quantile(seconds, 0.5),
              quantile(seconds, 0.99), quantile(seconds, 1));
  std::printf(
      "... of it when the train has come there: p50 %.2f, p99 %.2f, max %.2f s; before at most %.2f s at once\n",
      quantile(answers, 0.5), quantile(answers, 0.99), quantile(answers, 1), prepared_s);
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
  const int most_tries = options.other_leg ? 2000 : 100;
  for (int tries = 0; tries < most_tries; ++tries) {
    if (const auto trip = run_trip(networks, options, random)) return trip;
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
