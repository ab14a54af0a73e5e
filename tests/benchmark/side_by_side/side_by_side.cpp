// What a train says of its track where several run side by side: told rightly or on the neighbour, over crossovers in
// the dark, with services that are started anew.
#include <CLI/CLI.hpp>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <functional>

#include "measuring_tool.hpp"
#include "side_by_side/station.hpp"
#include "side_by_side/whole_train.hpp"

namespace railfix::measure {
namespace {

constexpr double kBeginM = 100;
constexpr double kBeforeEndM = 300;

struct Options {
  uint64_t seed = 1;
  int runs = 8;
  std::string only;
  bool each = false;
};

Ride ride_over(const StationPlan& plan, const Station& station, uint64_t seed) {
  Ride ride;
  ride.map = station.map;
  ride.begin_m = kBeginM;
  ride.end_m = plan.length_m - kBeforeEndM;
  ride.seed = seed;
  ride.camera_scale = 0.002;
  return ride;
}

track::EdgePosition told_on(const Station& station, size_t track) {
  return {station.edges[track].front(), kBeginM, track::Direction::forward};
}

/// Double track, masts alike beside both, balises of its own on each.
Ride told(core::Random& random, size_t track) {
  const StationPlan plan{.mast_every_m = 60, .balise_every_m = 700};
  const auto made = station(plan, random);
  Ride ride = ride_over(plan, made, random.next());
  ride.way = way_through(made, 0, 0, random);
  ride.told = told_on(made, track);
  ride.gnss = random.uniform() < 0.5;
  return ride;
}

/// One crossover, taken by half of the trains, while the camera tells nothing.
Ride in_the_dark(const StationPlan& plan, core::Random& random) {
  const auto made = station(plan, random);
  Ride ride = ride_over(plan, made, random.next());
  ride.way = way_through(made, 0, 0.5, random);
  ride.told = told_on(made, 0);
  ride.dark = {{900, 1300}};
  return ride;
}

Ride without_gyro(core::Random& random) {
  Ride ride = in_the_dark({.length_m = 14000, .crossovers = {{0, 1, 1000}}, .balise_every_m = 1500}, random);
  ride.gyro = false;
  return ride;
}

/// It fails on the way there, in one of three ways, for a minute.
Ride failing_gyro(core::Random& random) {
  using enum testing::GyroFault;
  Ride ride = in_the_dark({.length_m = 4000, .crossovers = {{0, 1, 1000}}, .balise_every_m = 700}, random);
  ride.gyro_fault = std::array{stuck, bias, noise}[static_cast<size_t>(random.uniform(0, 3))];
  const double bias_rps = (random.uniform() < 0.5 ? -1 : 1) * random.uniform(0.005, 0.1);
  ride.gyro_fault_rps = ride.gyro_fault == noise ? random.uniform(0.01, 0.1) : bias_rps;
  ride.gyro_fails.from_m = 1000 - random.uniform(-50, 200);
  ride.gyro_fails.to_m = ride.gyro_fails.from_m + 60 * ride.speed_mps;
  return ride;
}

/// Two to four tracks, a crossover every 300 to 1200 m, half of them taken, half of them dark; map_matcher begun anew.
Ride anywhere(core::Random& random) {
  StationPlan plan{.tracks = 2 + static_cast<int>(random.uniform(0, 3)), .length_m = 8000, .balise_every_m = 700};
  for (double m = 700; m < plan.length_m - 800; m += random.uniform(300, 1200)) {
    const int left = static_cast<int>(random.uniform(0, plan.tracks - 1));
    plan.crossovers.push_back(random.uniform() < 0.5 ? Crossover{left, left + 1, m} : Crossover{left + 1, left, m});
  }
  const auto made = station(plan, random);
  Ride ride = ride_over(plan, made, random.next());
  const auto begin = static_cast<size_t>(random.uniform(0, plan.tracks));
  ride.way = way_through(made, static_cast<int>(begin), 0.5, random);
  ride.told = told_on(made, begin);
  ride.speed_mps = random.uniform(8, 30);
  ride.camera_scale = random.normal(0, 0.005);
  ride.gyro = random.uniform() < 0.5;
  ride.gnss = random.uniform() < 0.3;
  for (const auto& crossover : plan.crossovers) {
    if (random.uniform() < 0.5)
      ride.dark.push_back({crossover.at_m - random.uniform(20, 120), crossover.at_m + random.uniform(30, 330)});
    if (random.uniform() < 0.2) ride.matcher_anew.push_back(crossover.at_m + random.uniform(-60, 340));
  }
  return ride;
}

struct Scenario {
  const char* name;
  std::function<Ride(core::Random&)> draw;
  bool told_rightly = true;   // then nothing that is declared may be wrong
  double least_declared = 0;  // share of the states
  double most_declared = 1;
};

int measure(const Options& options) {
  const std::vector<Scenario> scenarios{
      {"told", [](core::Random& random) { return told(random, 0); }, true, 1.0},
      {"neighbour", [](core::Random& random) { return told(random, 1); }, false, 0, 0.2},
      {"dark", without_gyro, true, 0.6},
      {"gyro", failing_gyro, true, 0.2},
      {"anywhere", anywhere, true, 0.6},
  };
  bool failed = false;
  for (const auto& scenario : scenarios) {
    if (!options.only.empty() && options.only != scenario.name) continue;
    Tally sum;
    for (int i = 0; i < options.runs; ++i) {
      core::Random random(options.seed * 1'000'003 + static_cast<uint64_t>(i));
      const Tally tally = run(scenario.draw(random));
      if (options.each) std::printf("  %s %d: %s\n", scenario.name, i, tally.text().c_str());
      sum.add(tally);
    }
    std::printf("%s, %d runs: %s\n", scenario.name, options.runs, sum.text().c_str());
    const double declared = static_cast<double>(sum.declared) / static_cast<double>(std::max<size_t>(sum.states, 1));
    failed = failed || declared < scenario.least_declared || declared > scenario.most_declared || sum.outside > 0 ||
             sum.wrong_ok > 0 || (scenario.told_rightly && sum.wrong + sum.false_ones > 0);
  }
  std::printf("%s\n", failed ? "FAILED" : "PASSED");
  return failed ? 1 : 0;
}

}  // namespace
}  // namespace railfix::measure

int main(int argc, char** argv) {
  using namespace railfix;
  measure::Options options;
  CLI::App app{"Tracks side by side: real fusion, map_matcher and tpr_publisher in one process against the truth",
               "railfix-measure-side-by-side"};
  app.add_option("--seed", options.seed, "Other seeds, other stations and rides")->capture_default_str();
  app.add_option("--runs", options.runs, "Of every scenario")->check(CLI::Range(1, 1000000))->capture_default_str();
  app.add_option("--only", options.only, "One scenario")
      ->check(CLI::IsMember({"told", "neighbour", "dark", "gyro", "anywhere"}));
  app.add_flag("--each", options.each, "Print every run");
  return measure::run_tool(app, argc, argv, [&] { return measure::measure(options); });
}
