// How fast a place on the track is found: the matcher and the simulator ask thousands of times for every picture.
#include <benchmark/benchmark.h>

#include "core/random.hpp"
#include "track/alignment.hpp"

namespace {

using railfix::track::Alignment;
using railfix::track::CantPoint;
using railfix::track::Element;
using railfix::track::GradePoint;

/// 20 km of straights, clothoids and arcs with a profile and cant, like a main line.
Alignment main_line() {
  std::vector<Element> elements;
  std::vector<GradePoint> profile;
  std::vector<CantPoint> cant;
  double offset_m = 0;
  for (int i = 0; i < 40; ++i) {
    const double curvature = (i % 2 == 0 ? 1.0 : -1.0) / (400.0 + 20.0 * i);
    const double cant_m = 40.0 * curvature;
    profile.push_back({offset_m, 400.0 + i % 3, 60.0});
    for (const auto& [length, from, to] :
         {std::tuple(150.0, 0.0, 0.0), {80.0, 0.0, curvature}, {190.0, curvature, curvature}, {80.0, curvature, 0.0}}) {
      elements.push_back({length, from, to});
      cant.push_back({offset_m, from == 0.0 ? 0.0 : cant_m});
      offset_m += length;
    }
  }
  return Alignment::chained({2680000, 1250000, 0.3}, elements, profile, cant);
}

void at(benchmark::State& state) {
  const Alignment line = main_line();
  double s = 0;
  for (auto _ : state) {
    s = s > line.length_m() ? 0 : s + 97.3;
    benchmark::DoNotOptimize(line.at(s));
  }
}
BENCHMARK(at);

void curvature_at(benchmark::State& state) {
  const Alignment line = main_line();
  double s = 0;
  for (auto _ : state) {
    s = s > line.length_m() ? 0 : s + 97.3;
    benchmark::DoNotOptimize(line.curvature_at(s));
  }
}
BENCHMARK(curvature_at);

void nearest(benchmark::State& state) {
  const Alignment line = main_line();
  railfix::core::Random random(1);
  for (auto _ : state) {
    const auto pose = line.at(random.uniform(0, line.length_m())).pose;
    benchmark::DoNotOptimize(line.nearest(pose.easting_m + 1.5, pose.northing_m - 0.5));
  }
}
BENCHMARK(nearest);

}  // namespace
