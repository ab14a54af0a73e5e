// Time to draw one picture on one core: plain track, switches, tunnel.
#include <benchmark/benchmark.h>

#include "core/result.hpp"
#include "simulator/builtin_line.hpp"
#include "simulator/renderer.hpp"

namespace railfix::simulator {
namespace {

constexpr int kPlaces = 16;

struct Place {
  const char* start;
  double first_m;
};
constexpr Place kPlain{"1:100", 20.0};
constexpr Place kSwitches{"2:20", 5.0};
constexpr Place kTunnel{"3:700", 30.0};

Shot shot_at(double distance_m) {
  Shot shot;
  shot.pose = {0.003, 0.2094, 0.002, 0.02, 2.5};
  shot.distance_m = distance_m;
  shot.speed_mps = 20.0;
  shot.noise_seed = static_cast<uint64_t>(distance_m * 1000.0);
  return shot;
}

void draw(benchmark::State& state, const Place& place, const Strip& strip = {}) {
  const auto map = std::make_shared<const track::Map>(builtin_line());
  const auto line =
      core::value_or_throw(Line::make(map, core::value_or_throw(map->parse_position(place.start)), 400.0));
  RenderOptions options;
  options.strip = strip;
  const int width = static_cast<int>(state.range(0));
  const int height = width * 4 / 5;
  options.camera = {0.9 * width, 0.9 * width, 0.5 * (width - 1), 0.5 * (height - 1), 0, 0, 0, 0, width, height};
  const Renderer renderer(std::make_shared<const Line>(line), options);
  int k = 0;
  for (auto _ : state) {
    benchmark::DoNotOptimize(renderer.render(shot_at(place.first_m + 3.33 * (k++ % kPlaces))));
  }
}

BENCHMARK_CAPTURE(draw, plain, kPlain)->Arg(1280)->Arg(640)->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(draw, switches, kSwitches)->Arg(1280)->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(draw, own_track_only, kPlain, Strip{30.0, 0.9})->Arg(1280)->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(draw, tunnel, kTunnel)->Arg(1280)->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace railfix::simulator
