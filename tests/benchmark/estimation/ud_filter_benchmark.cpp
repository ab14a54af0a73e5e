// Cost of the UD filter against the dense filter with Joseph's update, at the size that fusion has: its states with 2
// to 4 clones before them.
#include <benchmark/benchmark.h>

#include "core/random.hpp"
#include "estimation/ud_filter.hpp"
#include "fusion/motion_filter.hpp"
#include "unit/estimation/joseph_filter.hpp"

namespace railfix::estimation {
namespace {

constexpr int kStates = static_cast<int>(fusion::StateIndex::count);
constexpr int kNoisy = 9;  // of them walk

int index(int n, fusion::StateIndex state) {
  return n - kStates + static_cast<int>(state);
}

StateMatrix transition(int n) {
  using enum fusion::StateIndex;
  StateMatrix phi = StateMatrix::Identity(n, n);
  for (const auto way : {camera_odometer, distance, wheel_odometer}) phi(index(n, way), index(n, speed)) = 0.0167;
  phi(index(n, speed), index(n, acceleration)) = 0.0167;
  return phi;
}

StateVector relative(int n) {
  StateVector h = StateVector::Zero(n);
  h(0) = -1;
  h(index(n, fusion::StateIndex::camera_odometer)) = 1;
  return h;
}

template <class Filter>
void cycle(benchmark::State& state, Filter filter) {
  const auto n = static_cast<int>(state.range(0));
  const StateMatrix phi = transition(n);
  const StateMatrix g = StateMatrix::Identity(n, n).rightCols(kNoisy);
  const StateVector q = StateVector::Constant(kNoisy, 1e-6);
  const StateVector h = relative(n);
  for (auto _ : state) {
    filter.propagate(phi, g, q);
    benchmark::DoNotOptimize(filter.update(h, 0.01, 1e-6));
  }
}

void ud_filter(benchmark::State& state) {
  cycle(state, UdFilter(StateVector(StateVector::Ones(state.range(0)))));
}
void joseph_filter(benchmark::State& state) {
  cycle(state, JosephFilter{StateMatrix::Identity(state.range(0), state.range(0))});
}
BENCHMARK(ud_filter)->Arg(kStates + 2)->Arg(kStates + 4);
BENCHMARK(joseph_filter)->Arg(kStates + 2)->Arg(kStates + 4);

}  // namespace
}  // namespace railfix::estimation
