#include "position.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>

#include "sensor_sets.hpp"
#include "simulator/builtin_line.hpp"
#include "support/train/verdict.hpp"

namespace railfix::train {
namespace {

using track::LandmarkKind;

constexpr double kNearM = 50;              // behind a reference
constexpr double kPassedM = 5;             // a sighting has come to fusion so far behind it
constexpr uint64_t kTripBefore = 500'000;  // to its seed
constexpr double kEveryM = 1;  // of the way a state counts: a train that stands for an hour is one place, not many

constexpr double kFrogSigmaM = 0.06;
constexpr double kUnheard = 1e3;  // sigma of a sensor that is not there

// As measured: drift up to 0.03 % over 26 km, 0.07 % in the mean over 100 m; portals 0.07 to 0.19 m. Frogs as wear and
// the map leave them.
SimulationPlan plan_of(const SensorSet& row, double every_m) {
  SimulationPlan plan;
  plan.duration_s = 6000;
  plan.camera = row.camera;
  plan.wheel = row.wheel;
  plan.imu = row.imu || row.curvature;
  plan.gnss = row.gnss;
  plan.shape = row.curvature;
  plan.landmark_spacing_m = row.landmarks ? every_m : 0;
  plan.fix_sigma_m = kFrogSigmaM;
  if (row.landmarks && every_m == 0) {
    plan.map_landmarks = {
        {LandmarkKind::frog, kFrogSigmaM}, {LandmarkKind::portal_in, 0.10}, {LandmarkKind::portal_out, 0.19}};
  }
  plan.visual_scale_error = 0.0003;
  plan.visual_wander = 0.0007;
  plan.outlier_share = 0;
  plan.false_fix_share = 0;
  plan.blind_spells = false;
  // Sightings and the shape of the track come from a camera, which is there then, but sees no ground.
  const bool moves = row.camera || row.wheel || row.imu || row.gnss;
  if (!moves) {
    plan.camera = true;
    plan.fault = {Sensor::camera, FaultKind::blind, 0, plan.duration_s, 0};
  }
  return plan;
}

fusion::FusionParameters parameters_of(const SensorSet& row) {
  fusion::FusionParameters parameters;
  if (!row.curvature) parameters.gyro_sigma_rps = kUnheard;
  if (!row.imu) parameters.accel_sigma_mps2 = kUnheard;
  return parameters;
}

// Places of the references that a run with landmarks has; the same for all rows.
std::vector<double> references_on(const track::Path& path, double every_m) {
  std::vector<double> places;
  for (double place_m = every_m; every_m > 0 && place_m < path.end_m(); place_m += every_m) places.push_back(place_m);
  if (every_m > 0) return places;
  for (const auto& mark : path.landmarks()) {
    const bool one = mark.kind == LandmarkKind::frog || mark.kind == LandmarkKind::portal_in ||
                     mark.kind == LandmarkKind::portal_out;
    if (one && mark.distance_m > 0) places.push_back(mark.distance_m);
  }
  return places;
}

bool near_one(const std::vector<double>& places, double distance_m) {
  const auto next = std::upper_bound(places.begin(), places.end(), distance_m);
  return next != places.begin() && distance_m - *std::prev(next) < kNearM;
}

// A whole trip of the same train before, with other references' errors and another drive.
std::optional<fusion::SavedScales> scales_of_trip_before(const SimulationPlan& plan, uint64_t seed,
                                                         const SensorSet& row,
                                                         const std::shared_ptr<const track::Map>& map,
                                                         const track::EdgePosition& start) {
  const TrainSimulation before(plan, seed + kTripBefore, map, start);
  auto fusion = core::value_or_throw(fusion::Fusion::create(parameters_of(row), map, before.start()));
  judge(before, fusion);
  const auto learnt = fusion.learnt_scales();
  if (!learnt) return std::nullopt;
  return fusion::SavedScales{*learnt, before.stamp_ns(before.duration_s()), "", 0, fusion.camera_lag()};
}

// Absolute errors of states a metre apart.
struct Errors {
  std::vector<float> all_m;     // from the start
  std::vector<float> behind_m;  // behind the first reference
  std::vector<float> near_m;    // close behind any
};

void run_once(const PositionPlan& asked, const SensorSet& row, int run, const std::shared_ptr<const track::Map>& map,
              Verdict& sum, Errors& errors, StanfordCounts& stanford) {
  const auto start = map->parse_position("1:100").value();
  const uint64_t seed = asked.seed * 1000 + static_cast<uint64_t>(run);
  SimulationPlan plan = plan_of(row, asked.every_m);
  std::optional<fusion::SavedScales> saved;
  if (asked.learnt) {
    plan.train = seed;
    saved = scales_of_trip_before(plan, seed, row, map, start);
    if (!saved) std::fprintf(stderr, "(run %d: the trip before has taught nothing)\n", run);
  }
  const TrainSimulation simulation(plan, seed, map, start);
  auto fusion = core::value_or_throw(fusion::Fusion::create(parameters_of(row), map, simulation.start(), saved));
  const auto places = references_on(simulation.path(), asked.every_m);
  double next_m = 0;
  int outside = 0;
  sum.add(judge(simulation, fusion, 0, [&](const fusion::TrainEstimate& state, double error_m) {
    if ((error_m > state.over_m || -error_m > state.under_m) && outside++ == 0) {
      std::fprintf(stderr, "(run %d outside at %.1f s, %.1f m: %.2f m in [-%.2f, +%.2f], %s)\n", run,
                   core::seconds(state.stamp_ns - simulation.stamp_ns(0)), state.distance_m, error_m, state.under_m,
                   state.over_m, state.reason.c_str());
    }
    const double true_m = simulation.truth_at(state.stamp_ns).distance_m;
    if (true_m < next_m) return;
    stanford.add(std::abs(error_m), error_m > 0 ? state.over_m : state.under_m);
    next_m = true_m + kEveryM;
    const auto size_m = static_cast<float>(std::abs(error_m));
    errors.all_m.push_back(size_m);
    if (true_m >= places.front() + kPassedM) errors.behind_m.push_back(size_m);
    if (near_one(places, true_m)) errors.near_m.push_back(size_m);
  }));
  if (run == 0) std::fprintf(stderr, "(%zu references on %.1f km)\n", places.size(), simulation.path().end_m() / 1000);
}

}  // namespace

StanfordCounts print_positions(const PositionPlan& asked) {
  const auto map = std::make_shared<const track::Map>(simulator::builtin_line("long").value());
  std::printf(
      "| sources | p50 (m) | p95 (m) | max (m) | p50 behind a reference | p95 behind one | max behind one | "
      "p95 within 50 m of one | mean interval (m) | outside |\n|---|--:|--:|--:|--:|--:|--:|--:|--:|--:|\n");
  StanfordCounts stanford;
  for (const auto& row : kSensorSets) {
    if (!asked.only.empty() && asked.only != row.name) continue;
    Verdict sum;
    Errors e;
    for (int run = 0; run < asked.runs; ++run) run_once(asked, row, run, map, sum, e, stanford);
    std::printf("| %s |", row.name);
    for (const double metres : {quantile(e.all_m, 0.5), quantile(e.all_m, 0.95), quantile(e.all_m, 1),
                                quantile(e.behind_m, 0.5), quantile(e.behind_m, 0.95), quantile(e.behind_m, 1),
                                quantile(e.near_m, 0.95), sum.width_sum_m / static_cast<double>(sum.states)})
      std::printf(metres < 1 ? " %.3f |" : metres < 100 ? " %.1f |" : " %.0f |", metres);
    std::printf(" %zu |\n", sum.outside);
    std::fflush(stdout);
  }
  return stanford;
}

}  // namespace railfix::train
