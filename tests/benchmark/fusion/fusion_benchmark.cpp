// Cost of one measurement in fusion, in order and with odometry steps that come 60 ms late (every one replays a
// little).
#include <benchmark/benchmark.h>

#include "support/train/simulation.hpp"

namespace railfix::fusion {
namespace {

void one_minute(benchmark::State& state) {
  train::SimulationPlan plan;
  plan.duration_s = 60;
  train::TrainSimulation simulation(plan, 1);
  auto& arrivals = simulation.arrivals;
  for (auto& arrival : arrivals) {
    if (std::holds_alternative<OdometryInput>(arrival.event))
      arrival.arrival_s += 1e-3 * static_cast<double>(state.range(0));
  }
  std::stable_sort(arrivals.begin(), arrivals.end(),
                   [](const auto& a, const auto& b) { return a.arrival_s < b.arrival_s; });
  for (auto _ : state) {
    auto fusion = core::value_or_throw(Fusion::create({}, simulation.map, simulation.start()));
    for (const auto& arrival : arrivals) benchmark::DoNotOptimize(fusion.add(arrival.event));
  }
  state.SetItemsProcessed(state.iterations() * static_cast<int64_t>(arrivals.size()));
}
BENCHMARK(one_minute)->Arg(0)->Arg(60)->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace railfix::fusion
