// Cost of the UD filter against the dense filter with Joseph's update, at the size that fusion has (9 states, 0 to 4
// clones).
#include <benchmark/benchmark.h>

#include "core/random.hpp"
#include "estimation/ud_filter.hpp"
#include "unit/estimation/joseph_filter.hpp"

namespace railfix::estimation {
namespace {

StateMatrix transition(int n) {
  StateMatrix phi = StateMatrix::Identity(n, n);
  phi(n - 9, n - 7) = 0.0167;
  phi(n - 7, n - 6) = 0.0167;
  return phi;
}

StateVector relative(int n) {
  StateVector h = StateVector::Zero(n);
  h(0) = -1;
  h(n - 9) = 1;
  return h;
}

template <class Filter>
void cycle(benchmark::State& state, Filter filter) {
  const auto n = static_cast<int>(state.range(0));
  const StateMatrix phi = transition(n);
  const StateMatrix g = StateMatrix::Identity(n, n).rightCols(4);
  const StateVector q = StateVector::Constant(4, 1e-6);
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
BENCHMARK(ud_filter)->Arg(9)->Arg(13);
BENCHMARK(joseph_filter)->Arg(9)->Arg(13);

}  // namespace
}  // namespace railfix::estimation
