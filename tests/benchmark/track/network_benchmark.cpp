// A national network of 20,000 km: reading it, finding the tracks near a place.
#include <benchmark/benchmark.h>
#include <unistd.h>

#include <cstdlib>
#include <filesystem>

#include "core/random.hpp"
#include "track/import/build.hpp"
#include "track/import/made/made_network.hpp"
#include "track/track_finder.hpp"

namespace {

using namespace railfix;  // NOLINT(google-build-using-namespace)
namespace fs = std::filesystem;

const std::shared_ptr<const track::Map>& network() {
  static const auto made = std::make_shared<const track::Map>(track::made_network({.track_km = 20000, .seed = 1}));
  return made;
}

void load_20000_km(benchmark::State& state) {
  const auto file = fs::temp_directory_path() / ("railfix_bench_" + std::to_string(::getpid()) + ".map");
  core::ok_or_throw(network()->save(file));
  for (auto _ : state) benchmark::DoNotOptimize(track::Map::load(file).ok());
  state.counters["file_MB"] = static_cast<double>(fs::file_size(file)) / 1e6;
  fs::remove(file);
}
BENCHMARK(load_20000_km)->Unit(benchmark::kMillisecond);

fs::path data_folder() {
  if (const char* folder = std::getenv("RAILFIX_DATA")) return folder;
  return fs::path(RAILFIX_SOURCE_DIR).parent_path() / "shared" / "data";
}

/// One more of it beside what is there already.
void append(const track::Map& more, double east_m, track::Map& all) {
  const auto edges = static_cast<uint32_t>(all.edges.size());
  const auto nodes = static_cast<uint32_t>(all.nodes.size());
  const auto landmarks = static_cast<uint32_t>(all.landmarks.size());
  for (track::Edge edge : more.edges) {
    edge.id += edges;
    edge.from_node += nodes;
    edge.to_node += nodes;
    all.edges.push_back(std::move(edge));
  }
  for (track::Node node : more.nodes) {
    node.id += nodes;
    node.easting_m += east_m;
    all.nodes.push_back(std::move(node));
  }
  for (const track::Connection& way : more.connections)
    all.connections.push_back({way.node + nodes, way.edge_a + edges, way.edge_b + edges, way.diverging});
  for (track::Landmark mark : more.landmarks) {
    mark.id += landmarks;
    mark.edge += edges;
    all.landmarks.push_back(std::move(mark));
  }
}

// As dense as a real one: an OpenStreetMap extract of 402 km with its yards, fifty times.
void load_20000_km_of_a_real_network(benchmark::State& state) {
  const fs::path extract = data_folder() / "network" / "osm" / "sankt_poelten.json";
  if (!fs::exists(extract)) return state.SkipWithError("skipped: ../shared/data is missing");
  const track::Map one = core::value_or_throw(track::build_map({extract}, {.with_clothoids = true})).map;
  track::Map all;
  for (int i = 0; i < 50; ++i) append(one, 1e5 * i, all);
  const auto file = fs::temp_directory_path() / ("railfix_bench_" + std::to_string(::getpid()) + ".map");
  core::ok_or_throw(all.save(file));
  for (auto _ : state) benchmark::DoNotOptimize(track::Map::load(file).ok());
  state.counters["edges"] = static_cast<double>(all.edges.size());
  state.counters["file_MB"] = static_cast<double>(fs::file_size(file)) / 1e6;
  fs::remove(file);
}
BENCHMARK(load_20000_km_of_a_real_network)->Unit(benchmark::kMillisecond);

// 300,000 masts: looked up in a map that was loaded (1), gone through in one that was made (0).
void landmarks_on_an_edge(benchmark::State& state) {
  static const auto made =
      std::make_shared<const track::Map>(track::made_network({.track_km = 20000, .seed = 1, .mast_spacing_m = 65}));
  std::shared_ptr<const track::Map> map = made;
  if (state.range(0) == 1) {
    const auto file = fs::temp_directory_path() / ("railfix_bench_" + std::to_string(::getpid()) + ".map");
    core::ok_or_throw(made->save(file));
    map = std::make_shared<const track::Map>(core::value_or_throw(track::Map::load(file)));
    fs::remove(file);
  }
  core::Random random(1);
  for (auto _ : state)
    benchmark::DoNotOptimize(map->landmarks_on(1 + static_cast<uint32_t>(random.next() % map->edges.size())).data());
  state.counters["landmarks"] = static_cast<double>(map->landmarks.size());
}
BENCHMARK(landmarks_on_an_edge)->Arg(0)->Arg(1)->Unit(benchmark::kMicrosecond);

void make_track_finder(benchmark::State& state) {
  const auto& map = network();  // made before the clock runs
  for (auto _ : state) benchmark::DoNotOptimize(track::TrackFinder(map));
}
BENCHMARK(make_track_finder)->Unit(benchmark::kMillisecond);

void tracks_near(benchmark::State& state) {
  const track::TrackFinder finder(network());
  core::Random random(1);
  const auto radius_m = static_cast<double>(state.range(0));
  size_t found = 0;
  for (auto _ : state) {
    const track::Edge& edge = network()->edges[random.next() % network()->edges.size()];
    const track::PlanPose& place = edge.alignment.starts().front();
    const auto near = finder.near(place.easting_m + random.uniform(-20, 20), place.northing_m + 5, radius_m);
    found += near.size();
    benchmark::DoNotOptimize(near.data());
  }
  state.counters["found"] = benchmark::Counter(static_cast<double>(found), benchmark::Counter::kAvgIterations);
}
BENCHMARK(tracks_near)->Arg(30)->Arg(500);

}  // namespace
