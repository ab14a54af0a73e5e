// Do the one-sided 95 % bounds of `railfix tpr compare` hold? Legs are drawn whose true ratio is known; printed is how
// often the truth lies above the upper bound (a system would be called good too easily) and below the lower one.
//
//   railfix-measure-gamab SEED CASES
#include <cmath>
#include <cstdio>
#include <cstdlib>

#include "compare/gamab.hpp"
#include "core/random.hpp"

namespace {

using namespace railfix;  // NOLINT(google-build-using-namespace)

constexpr double kRatio = 1.05;

struct Shape {
  const char* name;
  compare::Figure figure;
};
constexpr Shape kShapes[] = {{"normal errors, RMS", compare::Figure::root_mean_square},
                             {"heavy tails (Student, 4), RMS", compare::Figure::root_mean_square},
                             {"lengths (log-normal), mean", compare::Figure::mean},
                             {"normal, 1 to 30 pairs a leg", compare::Figure::root_mean_square}};

double student4(core::Random& random) {
  double squares = 0;
  for (int i = 0; i < 4; ++i) squares += std::pow(random.normal(0, 1), 2);
  return random.normal(0, 1) / std::sqrt(squares / 4);
}

void add_leg(size_t leg, size_t shape, core::Random& random, std::vector<compare::Sample>& samples) {
  if (shape == 2) {
    samples.push_back({leg, kRatio * std::exp(random.normal(0, 0.6)), std::exp(random.normal(0, 0.6))});
    return;
  }
  const auto shared = [&] { return shape == 1 ? student4(random) : random.normal(0, 1); };
  const double ours = shared();
  const double certified = shared();
  const size_t pairs = shape == 3 ? 1 + random.next() % 30 : 10;
  for (size_t i = 0; i < pairs; ++i)
    samples.push_back({leg, kRatio * (ours + random.normal(0, 0.1)), certified + random.normal(0, 0.1)});
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 3) {
    std::fputs("usage: railfix-measure-gamab SEED CASES\n", stderr);
    return 2;
  }
  core::Random random(std::strtoull(argv[1], nullptr, 10));
  const int cases = std::atoi(argv[2]);
  for (size_t shape = 0; shape < std::size(kShapes); ++shape) {
    for (const size_t legs : {10, 20, 40, 80}) {
      int above = 0;
      int below = 0;
      for (int i = 0; i < cases; ++i) {
        std::vector<compare::Sample> samples;
        for (size_t leg = 0; leg < legs; ++leg) add_leg(leg, shape, random, samples);
        const auto result = compare::compare_ratio(samples, kShapes[shape].figure, {});
        above += kRatio > result.high;
        below += kRatio < result.low;
      }
      std::printf("%-30s %3zu legs: truth above %.1f %%, below %.1f %% (nominal 5)\n", kShapes[shape].name, legs,
                  100.0 * above / cases, 100.0 * below / cases);
      std::fflush(stdout);
    }
  }
  return 0;
}
