#include "position.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>

#include "simulator/builtin_line.hpp"
#include "support/train/verdict.hpp"

namespace railfix::train {
namespace {

using track::LandmarkKind;

constexpr double kNearM = 50;              // behind a reference
constexpr uint64_t kTripBefore = 500'000;  // to its seed
constexpr double kEveryM = 1;  // of the way a state counts: a train that stands for an hour is one place, not many

struct Row {
  const char* name;
  bool camera, wheel, imu, gnss, curvature, landmarks;
};
constexpr Row kRows[] = {
    {"all, landmarks", true, true, true, true, true, true},
    {"all but GNSS, landmarks", true, true, true, false, true, true},
    {"curvature off, landmarks", true, true, true, false, false, true},
    {"camera, landmarks", true, false, false, false, false, true},
    {"wheel, IMU, landmarks", false, true, true, false, true, true},
    {"all but GNSS, curvature only", true, true, true, false, true, false},
    {"curvature and landmarks off", true, true, true, false, false, false},
    {"wheel, IMU, curvature", false, true, true, false, true, false},
    {"wheel, IMU", false, true, true, false, false, false},
    {"camera", true, false, false, false, false, false},
    {"wheel", false, true, false, false, false, false},
    {"GNSS, IMU", false, false, true, true, false, false},
};

// As measured: drift up to 0.03 % over 26 km, 0.07 % in the mean over 100 m; frogs 0.05 to 0.06 m, portals 0.07 to
// 0.19 m (docs/figures.md).
SimulationPlan plan_of(const Row& row) {
  SimulationPlan plan;
  plan.duration_s = 6000;
  plan.camera = row.camera;
  plan.wheel = row.wheel;
  plan.imu = row.imu;
  plan.gnss = row.gnss;
  plan.landmark_spacing_m = 0;
  if (row.landmarks) {
    plan.map_landmarks = {
        {LandmarkKind::frog, 0.06}, {LandmarkKind::portal_in, 0.10}, {LandmarkKind::portal_out, 0.19}};
  }
  plan.visual_scale_error = 0.0003;
  plan.visual_wander = 0.0007;
  plan.outlier_share = 0;
  plan.false_fix_share = 0;
  plan.blind_spells = false;
  return plan;
}

fusion::FusionParameters parameters_of(const Row& row) {
  fusion::FusionParameters parameters;
  if (!row.curvature) parameters.gyro_sigma_rps = 1e3;
  return parameters;
}

// Places of the references that a run with landmarks has; the same for all rows.
std::vector<double> references_on(const track::Path& path) {
  std::vector<double> places;
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
std::optional<fusion::SavedScales> scales_of_trip_before(const SimulationPlan& plan, uint64_t seed, const Row& row,
                                                         const std::shared_ptr<const track::Map>& map,
                                                         const track::EdgePosition& start) {
  const TrainSimulation before(plan, seed + kTripBefore, map, start);
  auto fusion = core::value_or_throw(fusion::Fusion::create(parameters_of(row), map, before.start()));
  judge(before, fusion);
  const auto learnt = fusion.learnt_scales();
  if (!learnt) return std::nullopt;
  return fusion::SavedScales{*learnt, before.stamp_ns(before.duration_s()), "", 0};
}

// Absolute errors of states a metre apart.
struct Errors {
  std::vector<float> all_m;     // from the start
  std::vector<float> behind_m;  // behind the first reference
  std::vector<float> near_m;    // close behind any
};

void run_once(const PositionPlan& asked, const Row& row, int run, const std::shared_ptr<const track::Map>& map,
              Verdict& sum, Errors& errors) {
  const auto start = map->parse_position("1:100").value();
  const uint64_t seed = asked.seed * 1000 + static_cast<uint64_t>(run);
  SimulationPlan plan = plan_of(row);
  std::optional<fusion::SavedScales> saved;
  if (asked.learnt) {
    plan.train = seed;
    saved = scales_of_trip_before(plan, seed, row, map, start);
    if (!saved) std::printf("(run %d: the trip before has taught nothing)\n", run);
  }
  const TrainSimulation simulation(plan, seed, map, start);
  auto fusion = core::value_or_throw(fusion::Fusion::create(parameters_of(row), map, simulation.start(), saved));
  const auto places = references_on(simulation.path());
  double next_m = 0;
  int outside = 0;
  sum.add(judge(simulation, fusion, 0, [&](const fusion::TrainEstimate& state, double error_m) {
    if ((error_m > state.over_m || -error_m > state.under_m) && outside++ == 0) {
      std::printf("(run %d outside at %.1f s, %.1f m: %.2f m in [-%.2f, +%.2f], %s)\n", run,
                  core::seconds(state.stamp_ns - simulation.stamp_ns(0)), state.distance_m, error_m, state.under_m,
                  state.over_m, state.reason.c_str());
    }
    if (state.path_distance_m < next_m) return;
    next_m = state.path_distance_m + kEveryM;
    const auto size_m = static_cast<float>(std::abs(error_m));
    errors.all_m.push_back(size_m);
    if (state.path_distance_m >= places.front()) errors.behind_m.push_back(size_m);
    if (near_one(places, state.path_distance_m)) errors.near_m.push_back(size_m);
  }));
  if (run == 0) std::printf("(%zu references on %.1f km)\n", places.size(), simulation.path().end_m() / 1000);
}

}  // namespace

void print_positions(const PositionPlan& asked) {
  const auto map = std::make_shared<const track::Map>(simulator::builtin_line("long").value());
  std::printf("%-30s %8s | %8s %8s %8s | %8s %8s %8s | %8s %8s | %9s %8s\n", "sensors", "km", "all p50", "all p95",
              "all max", "p50 (m)", "p95 (m)", "max (m)", "near p95", "near max", "width (m)", "outside");
  for (const auto& row : kRows) {
    if (!asked.only.empty() && asked.only != row.name) continue;
    Verdict sum;
    Errors e;
    for (int run = 0; run < asked.runs; ++run) run_once(asked, row, run, map, sum, e);
    std::printf("%-30s %8.1f | %8.3f %8.3f %8.3f | %8.3f %8.3f %8.3f | %8.3f %8.3f | %9.2f %8zu\n", row.name,
                sum.way_m / 1000, quantile(e.all_m, 0.5), quantile(e.all_m, 0.95), quantile(e.all_m, 1),
                quantile(e.behind_m, 0.5), quantile(e.behind_m, 0.95), quantile(e.behind_m, 1),
                quantile(e.near_m, 0.95), quantile(e.near_m, 1), sum.width_sum_m / static_cast<double>(sum.states),
                sum.outside);
    std::fflush(stdout);
  }
}

}  // namespace railfix::train
