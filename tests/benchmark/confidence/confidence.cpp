// railfix-measure-confidence: does the promised interval hold the train, over thousands of kilometres with one faulty
// sensor at a time? Sensor-level simulation (tests/support/train), the real fusion.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <fstream>
#include <iostream>
#include <limits>
#include <map>
#include <sstream>

#include "campaign.hpp"
#include "core/units.hpp"
#include "measuring_tool.hpp"
#include "number_between.hpp"
#include "position.hpp"
#include "whole_number.hpp"

namespace railfix::train {
namespace {

constexpr size_t kWideShown = 20;

struct Arguments {
  CampaignPlan plan;
  std::string fault = "all";
  std::string without;
  std::string stanford;
  std::string map;
  std::string start;
  double max_kmh = 150;
  double sudden_mps2 = 0;
  double back_kmh = 0;
  int64_t run = -1;
  int position = 0;
  std::string row;
  double saved_wrong = -1;
  double every_m = 0;
  bool learnt = false;
  bool map_matcher = false;
  bool list = false;
};

std::vector<FaultName> faults_named(const std::string& text) {
  std::vector<FaultName> chosen;
  if (text == "none") return chosen;
  for (const auto& [sensor, kind] : all_faults()) {
    const auto name = to_string(sensor) + ":" + to_string(kind);
    if (sensor != Sensor::none && (text == "all" || name == text || to_string(sensor) == text))
      chosen.emplace_back(sensor, kind);
  }
  if (chosen.empty()) throw core::BadInput("--fault " + text + ": give all, none, SENSOR or SENSOR:KIND (see --list)");
  return chosen;
}

/// What --without leaves out: sensors, and what is no fault of the campaign's but wrong at times in every run.
const std::map<std::string, void (*)(SimulationPlan&)>& left_out() {
  static const std::map<std::string, void (*)(SimulationPlan&)> all{
      {"camera", [](SimulationPlan& plan) { plan.camera = false; }},
      {"wheel", [](SimulationPlan& plan) { plan.wheel = false; }},
      {"imu", [](SimulationPlan& plan) { plan.imu = false; }},
      {"gnss", [](SimulationPlan& plan) { plan.gnss = false; }},
      {"landmarks", [](SimulationPlan& plan) { plan.landmark_spacing_m = 0; }},
      {"shape", [](SimulationPlan& plan) { plan.shape = false; }},
      {"tunnels", [](SimulationPlan& plan) { plan.blind_spells = false; }},
      {"slip", [](SimulationPlan& plan) { plan.slip = false; }},
      {"false-fixes", [](SimulationPlan& plan) { plan.false_fix_share = 0; }}};
  return all;
}

std::string names_left_out() {
  std::string names;
  for (const auto& [name, leave_out] : left_out()) names += (names.empty() ? "" : ", ") + name;
  return names;
}

void leave_out(SimulationPlan& plan, const std::string& names) {
  std::istringstream list(names);
  for (std::string name; std::getline(list, name, ',');) {
    const auto found = left_out().find(name);
    if (found == left_out().end())
      throw core::BadInput("--without " + name + ": no such thing; there are " + names_left_out());
    found->second(plan);
  }
}

void load_map(Arguments& a) {
  if (a.map.empty()) {
    if (!a.start.empty()) throw core::BadInput("--start is a place on a map: give --map, too");
    return;
  }
  if (a.start.empty()) throw core::BadInput("--map " + a.map + ": where do the trains begin? Give --start EDGE:OFFSET");
  auto map = std::make_shared<const track::Map>(core::value_or_throw(track::Map::load(a.map)));
  a.plan.starts.push_back(core::value_or_throw(map->parse_position(a.start)));
  a.plan.map = std::move(map);
}

void print_row(const std::string& name, size_t runs, Verdict verdict) {
  const auto states = static_cast<double>(std::max<size_t>(verdict.states, 1));
  std::printf("%-28s %5zu %8.1f %9zu %8zu %8.2f %7.2f %6zu %7.2f %8.2f %8.2f %8.2f\n", name.c_str(), runs,
              verdict.way_m / 1000, verdict.states, verdict.outside, verdict.worst_excess_m,
              100 * static_cast<double>(verdict.wider) / states, verdict.wider_unsaid,
              100 * static_cast<double>(verdict.not_ok) / states, verdict.width_sum_m / states,
              quantile(verdict.errors_m, 0.95), quantile(verdict.errors_m, 1));
}

void print_widths(const Verdict& sum) {
  const auto percent = [&](size_t states) {
    return 100 * static_cast<double>(states) / static_cast<double>(std::max<size_t>(sum.states, 1));
  };
  const size_t named = sum.wider - sum.wider_placeless - sum.wider_first - sum.wider_alone;
  std::printf("wider than 5 m + 5 %% of the way since the last sure reference: %.2f %% of the states\n",
              percent(sum.wider));
  std::printf(
      "  %.2f %% without a place on the map, %.2f %% before the first reference, %.2f %% with a sensor, a fix or "
      "the track in doubt, %.2f %% with nothing else wrong any more\n",
      percent(sum.wider_placeless), percent(sum.wider_first), percent(named), percent(sum.wider_alone));
  std::printf("  counted from the last landmark, before another has confirmed it: %.2f %%\n",
              percent(sum.wider_of_last));
}

std::string to_string(const BadRun& run) {
  char text[120];
  std::snprintf(text, sizeof text, "run %llu: %s %s from %.1f s to %.1f s, size %g",
                static_cast<unsigned long long>(run.number), to_string(run.fault.sensor).c_str(),
                to_string(run.fault.kind).c_str(), run.fault.begin_s, run.fault.end_s, run.fault.size);
  return text;
}

void print(const CampaignResult& result) {
  std::printf("%-28s %5s %8s %9s %8s %8s %7s %6s %7s %8s %8s %8s\n", "fault", "runs", "km", "states", "outside",
              "by (m)", "wider%", "unsaid", "not ok%", "mean(m)", "p95(m)", "max(m)");
  for (const auto& [name, verdict] : result.by_fault)
    print_row(to_string(name.first) + " " + to_string(name.second), result.runs.at(name), verdict);
  print_row("all", result.run_count, result.sum);
  print_widths(result.sum);
  for (const auto& bad : result.bad)
    std::printf("%s: %zu outside by up to %.2f m, %zu wider unsaid\n", to_string(bad).c_str(), bad.outside,
                bad.excess_m, bad.unsaid);
  if (result.saved.size() > 1 || !result.saved.contains(fusion::SavedScalesAre::none)) {
    const auto runs = [&](fusion::SavedScalesAre what) {
      return result.saved.contains(what) ? result.saved.at(what) : 0;
    };
    std::printf("saved scales: confirmed in %zu runs, contradicted in %zu, still on trial in %zu\n",
                runs(fusion::SavedScalesAre::confirmed), runs(fusion::SavedScalesAre::contradicted),
                runs(fusion::SavedScalesAre::on_trial));
  }
  std::printf(
      "on a leg that the train did not take: %zu states, %zu of them declared and ok, for up to %.1f s (run %llu), "
      "%.0f m\n",
      result.sum.other_leg, result.sum.other_leg_sure, result.sum.other_leg_sure_s,
      static_cast<unsigned long long>(result.longest_other_leg), result.sum.other_leg_sure_m);
  std::printf("outside: %zu states, %zu of them usable, %zu ok, %zu since a place was given up; no place: %zu of %zu\n",
              result.sum.outside, result.sum.outside_usable, result.sum.outside_ok, result.sum.outside_again,
              result.sum.placeless, result.sum.states);
  auto wide = result.wide;
  std::ranges::sort(wide, std::ranges::greater{}, &BadRun::wider_share);
  for (size_t i = 0; i < std::min(wide.size(), kWideShown); ++i)
    std::printf("%s: %.0f %% of the states wider than allowed\n", to_string(wide[i]).c_str(),
                100 * wide[i].wider_share);
}

// One run, a line a second.
void trace(const CampaignPlan& plan, uint64_t number) {
  const auto simulation = simulation_of(plan, number);
  auto fusion = fusion_of(plan, simulation, number);
  const auto& fault = simulation.plan().fault;
  std::printf("%s %s from %.1f s to %.1f s, size %g\n", to_string(fault.sensor).c_str(), to_string(fault.kind).c_str(),
              fault.begin_s, fault.end_s, fault.size);
  double next_s = 0;
  bool was_outside = false;
  const double begin_s = core::seconds(simulation.stamp_ns(0));
  judge(simulation, fusion, 0, [&](const fusion::TrainEstimate& e, double error_m) {
    const double t_s = core::seconds(e.stamp_ns) - begin_s;
    const bool outside = error_m > e.over_m || -error_m > e.under_m;
    if (t_s < next_s && t_s > next_s - 2 && outside == was_outside) return;
    next_s = t_s + 1;
    was_outside = outside;
    std::printf(
        "%8.2f s %8.1f m %5.1f m/s error %8.3f in [-%.2f, +%.2f] sigma %.3f since %.0f scales %.4f %.4f track %u "
        "%.4f%s %s%s\n",
        t_s, e.distance_m, e.speed_mps, error_m, e.under_m, e.over_m, e.sigma_m, e.since_reference_m, e.visual_scale,
        e.wheel_scale, e.position.edge, e.track_probability, simulation.on_way(e.position) ? "" : " OTHER LEG",
        outside ? "OUTSIDE " : "", e.reason.c_str());
  });
}

void write_stanford(const std::string& file, const StanfordCounts& counts, const std::string& title) {
  if (file.empty()) return;
  std::ofstream out(file);
  out << counts.svg(title);
  if (!out) throw core::BadInput("--stanford " + file + ": cannot be written");
}

void add_options(CLI::App& app, Arguments& a) {
  auto& s = a.plan.simulation;
  app.add_option("--km", a.plan.km, "Way to run in total")
      ->check(tool::number_between(0.001, 1e9))
      ->capture_default_str();
  app.add_option("--seed", a.plan.seed, "Other seeds, other runs")->check(tool::whole_number())->capture_default_str();
  app.add_option("--threads", a.plan.threads, "Threads")->check(tool::whole_number(1, 1024))->capture_default_str();
  app.add_option("--duration-s", a.plan.duration_s, "Length of one run")
      ->check(tool::number_between(1, 1e6))
      ->capture_default_str();
  app.add_option("--max-kmh", a.max_kmh, "Highest speed")->check(tool::number_between(1, 1000))->capture_default_str();
  app.add_option("--sudden", a.sudden_mps2,
                 "Accelerate and brake so hard (m/s2), from one moment to the next; 0: gently")
      ->check(tool::number_between(0, 10));
  app.add_option("--back-kmh", a.back_kmh, "The trains set back now and then, so fast at most; 0: they never do")
      ->check(tool::number_between(0, 160));
  app.add_option("--landmarks-m", s.landmark_spacing_m, "Mean distance of landmarks, 0 = none")
      ->check(tool::number_between(0, 1e6))
      ->capture_default_str();
  app.add_option("--switches-m", s.switch_spacing_m, "Mean distance of facing points, 0 = none")
      ->check(tool::number_between(0, 1e6))
      ->capture_default_str();
  app.add_option("--fault", a.fault, "all, none, SENSOR or SENSOR:KIND")->capture_default_str();
  app.add_option("--without", a.without, "Leave out any of " + names_left_out() + " (comma between)");
  app.add_option("--map", a.map, "Compiled map instead of random lines");
  app.add_option("--start", a.start, "EDGE:OFFSET[:+|-] on the map, where every run begins");
  app.add_option("--stanford", a.stanford, "Write the Stanford diagram (SVG)");
  app.add_option("--run", a.run, "Print one run of the campaign second by second")
      ->check(tool::whole_number(0, std::numeric_limits<int64_t>::max()));
  app.add_flag(
      "--sightings", s.sightings,
      "Places come from masts and balises that are sighted, by the real matcher, on a map that is not quite right");
  app.add_flag("--map-matcher", a.map_matcher,
               "... by the whole map_matcher, which chooses the track, too, and searches for a start that nobody told");
  app.add_option("--position", a.position,
                 "What each source is worth, frogs and portals as references: a table of so many runs of 33 km")
      ->check(tool::whole_number(1, 1000000));
  app.add_option("--row", a.row, "... with this set of sensors alone, as the table names it");
  app.add_option("--every-m", a.every_m, "... with a reference as good as a frog every so many metres instead")
      ->check(tool::number_between(0, 1e6));
  app.add_flag("--learnt", a.learnt, "... with the scales that an earlier trip of the same train has taught");
  app.add_option(
         "--saved-wrong", a.saved_wrong,
         "Every run begins with saved scales that are wrong by this share: the camera's, the wheel's and both in "
         "turn; 0: right")
      ->check(tool::number_between(0, 1));
  app.add_option("--unknown-start", a.plan.unknown_start_share, "Share of the runs that are not told where they begin")
      ->check(tool::number_between(0, 1))
      ->capture_default_str();
  app.add_option("--start-wrong-m", s.start_wrong_m,
                 "Every start is told too far ahead, by a fifth of this at least: how long until fusion says so?")
      ->check(tool::number_between(0, 100000));
  app.add_flag("--slip-always", a.plan.slip_always, "The wheel slips beside every fault: two faults at once");
  app.add_flag("--list", a.list, "Print the faults");
}

void list_faults() {
  for (const auto& [sensor, kind] : all_faults()) std::cout << to_string(sensor) << ":" << to_string(kind) << "\n";
}

void fill_plan(Arguments& a) {
  auto& s = a.plan.simulation;
  a.plan.faults = faults_named(a.fault);
  s.max_speed_mps = a.max_kmh / 3.6;
  if (a.sudden_mps2 > 0) s.style = DriveStyle::sudden(a.sudden_mps2);
  s.style.back_mps = core::mps_from_kmh(a.back_kmh);
  leave_out(s, a.without);
  if (a.map_matcher) {
    leave_to_map_matcher(s);
    std::erase(a.plan.faults, FaultName{Sensor::fix, FaultKind::wrong_branch});
  }
  if (s.sightings) s.landmark_spacing_m = 0;
  if (a.saved_wrong >= 0) a.plan.saved_wrong = a.saved_wrong;
  load_map(a);
}

int measure_positions(const Arguments& a) {
  const auto stanford = print_positions({a.plan.seed, a.position, a.row, a.every_m, a.learnt});
  char title[100];
  std::snprintf(title, sizeof title, "what each source is worth: %d runs, seed %llu", a.position,
                static_cast<unsigned long long>(a.plan.seed));
  write_stanford(a.stanford, stanford, title);
  return 0;
}

int measure_campaign(const Arguments& a) {
  double next_km = 0;
  const auto result = run_campaign(a.plan, [&](const Verdict& sum) {
    if (sum.way_m < 1000 * next_km) return;
    next_km += a.plan.km / 50;
    std::fprintf(stderr, "%.0f of %.0f km, %zu of %zu states outside\n", sum.way_m / 1000, a.plan.km, sum.outside,
                 sum.states);
  });
  print(result);
  char title[100];
  std::snprintf(title, sizeof title, "%.0f km, %zu runs, seed %llu, faults: ", result.sum.way_m / 1000,
                result.run_count, static_cast<unsigned long long>(a.plan.seed));
  write_stanford(a.stanford, result.stanford, title + a.fault);
  std::printf("%s: %zu of %zu states outside their interval, %zu wider than allowed without saying so\n",
              result.bad.empty() ? "PASSED" : "FAILED", result.sum.outside, result.sum.states, result.sum.wider_unsaid);
  return result.bad.empty() ? 0 : 1;
}

int measure_all(Arguments& a) {
  if (a.list) {
    list_faults();
    return 0;
  }
  fill_plan(a);
  if (a.run >= 0) {
    trace(a.plan, static_cast<uint64_t>(a.run));
    return 0;
  }
  return a.position > 0 ? measure_positions(a) : measure_campaign(a);
}

Arguments defaults() {
  Arguments a;
  a.plan.simulation = campaign_plan();
  a.plan.unknown_start_share = 0.1;
  return a;
}

int run(int argc, char** argv) {
  CLI::App app("Confidence campaign: simulated sensors with faults through fusion, the interval against the truth",
               "railfix-measure-confidence");
  auto arguments = defaults();
  add_options(app, arguments);
  return measure::run_tool(app, argc, argv, [&] { return measure_all(arguments); });
}

}  // namespace
}  // namespace railfix::train

int main(int argc, char** argv) {
  return railfix::train::run(argc, argv);
}
