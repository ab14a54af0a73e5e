// Do the one-sided 95 % bounds of `railfix tpr compare` hold? Legs are drawn whose true ratio is known; printed is how
// often the truth lies above the upper bound (a system would be called good too easily) and below the lower one. Ends
// with 1 where a share is beyond 5 % by more than chance, in the shapes for which the bounds promise it.
//
//   railfix-measure-gamab SEED CASES
#include <cmath>
#include <cstdio>

#include "compare/gamab.hpp"
#include "core/random.hpp"
#include "measuring_tool.hpp"
#include "whole_number.hpp"

namespace {

using namespace railfix;  // NOLINT(google-build-using-namespace)
using compare::Figure;
using core::Random;

constexpr double kRatio = 1.05;
constexpr double kNoise = 0.1;  // beside the error that a leg's pairs share
constexpr double kNominal = 0.05;

double normal(Random& random) {
  return random.normal(0, 1);
}

/// Student, 4 degrees of freedom: variance 2.
double heavy(Random& random) {
  double squares = 0;
  for (int i = 0; i < 4; ++i) squares += std::pow(random.normal(0, 1), 2);
  return random.normal(0, 1) / std::sqrt(squares / 4);
}

/// One leg of twenty is five times as bad: variance 2.2.
double rarely_bad(Random& random) {
  return (random.uniform() < 0.05 ? 5 : 1) * random.normal(0, 1);
}

double length(Random& random) {
  return std::exp(random.normal(0, 0.6));
}
double even_length(Random& random) {
  return std::exp(random.normal(0, 0.3));
}
double wild_length(Random& random) {
  return std::exp(random.normal(0, 0.9));
}

struct System {
  double (*leg)(Random&);
  double expected;  // mean square of an error, mean of a length
};
constexpr System kNormal{normal, 1};
constexpr System kHeavy{heavy, 2};
constexpr System kRarelyBad{rarely_bad, 2.2};

struct Shape {
  const char* name;
  Figure figure;
  System ours;
  System certified;
  bool promised;  // both alike
  bool uneven_legs = false;
};

const Shape kShapes[] = {
    {"normal errors, RMS", Figure::root_mean_square, kNormal, kNormal, true},
    {"heavy tails (Student, 4), RMS", Figure::root_mean_square, kHeavy, kHeavy, true},
    {"lengths (log-normal), mean", Figure::mean, {length, 0}, {length, 0}, true},
    {"normal, 1 to 30 pairs a leg", Figure::root_mean_square, kNormal, kNormal, true, true},
    {"rarely bad, both", Figure::root_mean_square, kRarelyBad, kRarelyBad, true},
    {"heavy tails ours only", Figure::root_mean_square, kHeavy, kNormal, false},
    {"heavy tails certified only", Figure::root_mean_square, kNormal, kHeavy, false},
    {"lengths, ours wilder", Figure::mean, {wild_length, std::exp(0.405)}, {even_length, std::exp(0.045)}, false},
    {"lengths, certified wilder", Figure::mean, {even_length, std::exp(0.045)}, {wild_length, std::exp(0.405)}, false},
    {"rarely bad ours only", Figure::root_mean_square, kRarelyBad, kNormal, false},
    {"rarely bad certified only", Figure::root_mean_square, kNormal, kRarelyBad, false}};

double truth_of(const Shape& shape) {
  if (shape.figure == Figure::mean)
    return shape.promised ? kRatio : kRatio * shape.ours.expected / shape.certified.expected;
  return kRatio * std::sqrt((shape.ours.expected + kNoise * kNoise) / (shape.certified.expected + kNoise * kNoise));
}

void add_leg(size_t leg, const Shape& shape, Random& random, std::vector<compare::Sample>& samples) {
  const double ours = shape.ours.leg(random);
  const double certified = shape.certified.leg(random);
  if (shape.figure == Figure::mean) {
    samples.push_back({leg, kRatio * ours, certified});
    return;
  }
  const size_t pairs = shape.uneven_legs ? 1 + random.next() % 30 : 10;
  for (size_t i = 0; i < pairs; ++i)
    samples.push_back({leg, kRatio * (ours + random.normal(0, kNoise)), certified + random.normal(0, kNoise)});
}

/// Beyond the nominal share by more than three of its standard deviations.
bool too_often(int wrong, int cases) {
  const double expected = kNominal * cases;
  return wrong > expected + 3 * std::sqrt(expected * (1 - kNominal));
}

int measure_bounds(uint64_t seed, int cases) {
  Random random(seed);
  bool holds = true;
  for (const auto& shape : kShapes) {
    const double truth = truth_of(shape);
    for (const size_t legs : {10, 20, 40, 80}) {
      int above = 0;
      int below = 0;
      double log_high = 0;
      for (int i = 0; i < cases; ++i) {
        std::vector<compare::Sample> samples;
        for (size_t leg = 0; leg < legs; ++leg) add_leg(leg, shape, random, samples);
        const auto result = compare::compare_ratio(samples, shape.figure, {});
        above += truth > result.high;
        below += truth < result.low;
        log_high += std::log(result.high / truth) / cases;
      }
      holds &= !shape.promised || !(too_often(above, cases) || too_often(below, cases));
      std::printf("%-30s %3zu legs: truth above %4.1f %%, below %4.1f %% (%s 5), upper bound %.2f of the truth\n",
                  shape.name, legs, 100.0 * above / cases, 100.0 * below / cases,
                  shape.promised ? "at most" : "alike would be", std::exp(log_high));
      std::fflush(stdout);
    }
  }
  std::puts(holds ? "PASSED" : "FAILED: a bound that is promised does not hold");
  return holds ? 0 : 1;
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app("Do the one-sided 95 % bounds of `railfix tpr compare` hold?", "railfix-measure-gamab");
  uint64_t seed = 0;
  int cases = 0;
  app.add_option("SEED", seed, "Other seeds, other legs")->required()->check(tool::whole_number());
  app.add_option("CASES", cases, "Of each shape and number of legs")
      ->required()
      ->check(tool::whole_number(1, 1'000'000'000));
  return measure::run_tool(app, argc, argv, [&] { return measure_bounds(seed, cases); });
}
