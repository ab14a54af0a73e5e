// Cost of one measurement in fusion, in order and with odometry steps that come 60 ms late (every one replays a
// little).
#include <benchmark/benchmark.h>

#include "unit/fusion/train_simulation.hpp"

namespace railfix::fusion {
namespace {

void one_minute(benchmark::State& state) {
  SimulationPlan plan;
  plan.duration_s = 60;
  const TrainSimulation simulation(plan, 1);
  const int64_t delay_ns = state.range(0) * 1'000'000;
  std::vector<std::pair<int64_t, Event>> arrivals;
  for (const auto& event : simulation.events) {
    arrivals.emplace_back(TrainSimulation::stamp(event) + (std::holds_alternative<OdometryInput>(event) ? delay_ns : 0),
                          event);
  }
  std::stable_sort(arrivals.begin(), arrivals.end(), [](const auto& a, const auto& b) { return a.first < b.first; });
  for (auto _ : state) {
    auto fusion = core::value_or_throw(Fusion::create({}, simulation.map, simulation.start()));
    for (const auto& [when, event] : arrivals) benchmark::DoNotOptimize(fusion.add(event));
  }
  state.SetItemsProcessed(state.iterations() * static_cast<int64_t>(arrivals.size()));
}
BENCHMARK(one_minute)->Arg(0)->Arg(60)->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace railfix::fusion
