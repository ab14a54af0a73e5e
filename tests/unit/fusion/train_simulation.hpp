// A train on a random line with imperfect sensors, at the level of measurements (no pictures). Everything follows from
// the seed.
#pragma once

#include <algorithm>
#include <cmath>
#include <memory>
#include <vector>

#include "core/random.hpp"
#include "core/time.hpp"
#include "core/units.hpp"
#include "fusion/fusion.hpp"

namespace railfix::fusion {

/// Which sensors there are and how wrong they may be; sizes are those of one standard deviation unless they say
/// otherwise.
struct SimulationPlan {
  double duration_s = 120;
  bool camera = true;
  bool wheel = true;
  bool imu = true;
  bool gnss = true;
  double landmark_spacing_m = 400;  // 0 = none
  double visual_scale_error = 0.007;
  double wheel_scale_error = 0.007;
  double step_noise_m = 0.002;
  double outlier_share = 0.003;   // of odometry steps: one sleeper more or less
  double false_fix_share = 0.02;  // of fixes: somewhere else, with full confidence
  bool blind_spells = true;       // 5 to 15 s without camera, now and then
  bool slip = true;               // wheel turns up to 30 % too fast or slow for some seconds
  double start_sigma_m = 0.3;
};

struct TruthSample {
  int64_t stamp_ns = 0;
  double distance_m = 0;
  double speed_mps = 0;
};

inline std::shared_ptr<const track::Map> random_line(core::Random& random, double length_m) {
  auto map = std::make_shared<track::Map>();
  std::vector<track::Element> elements;
  double sum_m = 0;
  while (sum_m < length_m) {
    const double curvature = (random.uniform() < 0.5 ? -1 : 1) / random.uniform(400, 2500);
    for (const auto& e :
         {track::Element{random.uniform(150, 900), 0, 0}, track::Element{80, 0, curvature},
          track::Element{random.uniform(80, 500), curvature, curvature}, track::Element{80, curvature, 0}}) {
      elements.push_back(e);
      sum_m += e.length_m;
    }
  }
  std::vector<track::GradePoint> profile;
  double elevation_m = 400;
  for (double offset_m = 0; offset_m < sum_m; offset_m += 800) {
    profile.push_back({offset_m, elevation_m, 100});
    elevation_m += 800 * random.uniform(-0.015, 0.015);
  }
  auto alignment = track::Alignment::chained({1000, 2000, random.uniform(0, 6)}, elements, profile);
  map->edges.push_back({1, "line", 1, 2, "", std::move(alignment)});
  map->nodes = {{1, track::NodeKind::end, "", 0, 0}, {2, track::NodeKind::end, "", 0, 0}};
  return map;
}

/// Measurements of one run in the order of their stamps, with the truth at every 0.05 s.
class TrainSimulation {
 public:
  static constexpr double kStartOffsetM = 200;

  TrainSimulation(const SimulationPlan& plan, uint64_t seed) : plan_(plan), random_(seed) {
    map = random_line(random_, kStartOffsetM + 45 * plan.duration_s + 1000);
    drive();
    if (plan.camera) make_steps();
    if (plan.wheel) make_pulses();
    if (plan.imu) make_inertial();
    if (plan.gnss) make_gnss();
    if (plan.landmark_spacing_m > 0) make_fixes();
    std::stable_sort(events.begin(), events.end(), [](const Event& a, const Event& b) { return stamp(a) < stamp(b); });
  }

  static int64_t stamp(const Event& event) {
    return std::visit([](const auto& input) { return input.stamp_ns; }, event);
  }
  [[nodiscard]] TruthSample truth_at(int64_t stamp_ns) const {
    const double t =
        std::clamp(core::seconds(stamp_ns - kBeginNs) / kTickS, 0.0, static_cast<double>(truth.size() - 2));
    const auto i = static_cast<size_t>(t);
    const double part = t - static_cast<double>(i);
    return {stamp_ns, truth[i].distance_m + part * (truth[i + 1].distance_m - truth[i].distance_m),
            truth[i].speed_mps + part * (truth[i + 1].speed_mps - truth[i].speed_mps)};
  }
  [[nodiscard]] track::EdgePosition start() const {
    return {1, kStartOffsetM + start_error_m, track::Direction::forward};
  }

  std::shared_ptr<const track::Map> map;
  std::vector<TruthSample> truth;
  std::vector<Event> events;
  double start_error_m = 0;

 private:
  static constexpr int64_t kBeginNs = 1'700'000'000'000'000'000;
  static constexpr double kTickS = 0.05;

  struct Spell {
    double begin_s;
    double end_s;
    double size;
  };

  [[nodiscard]] int64_t ns(double t_s) const { return kBeginNs + core::to_ns(t_s); }

  void drive() {
    start_error_m = plan_.start_sigma_m * random_.normal();
    double speed = random_.uniform() < 0.5 ? 0 : random_.uniform(5, 30);
    double distance = 0;
    double accel = 0;
    double target = random_.uniform(5, 42);
    double change_s = random_.uniform(10, 40);
    for (int i = 0; i * kTickS <= plan_.duration_s + 1; ++i) {
      truth.push_back({ns(i * kTickS), distance, speed});
      if (i * kTickS > change_s) {
        target = random_.uniform() < 0.25 ? 0 : random_.uniform(3, 42);
        change_s += random_.uniform(10, 40);
      }
      const double wanted = std::clamp(0.5 * (target - speed), -0.9, 0.7);
      accel += std::clamp(wanted - accel, -0.6 * kTickS, 0.6 * kTickS);
      const double before = speed;
      speed = std::max(0.0, speed + accel * kTickS);
      if (speed == 0) accel = 0;
      distance += 0.5 * (before + speed) * kTickS;
    }
  }

  std::vector<Spell> spells(double every_s, double shortest_s, double longest_s, double size) {
    std::vector<Spell> result;
    for (double t = random_.uniform(0, every_s); t < plan_.duration_s; t += every_s * random_.uniform(0.5, 1.5)) {
      result.push_back({t, t + random_.uniform(shortest_s, longest_s), random_.uniform(-size, size)});
    }
    return result;
  }
  static const Spell* within(const std::vector<Spell>& all, double t_s) {
    const auto it =
        std::find_if(all.begin(), all.end(), [&](const Spell& s) { return t_s >= s.begin_s && t_s < s.end_s; });
    return it == all.end() ? nullptr : &*it;
  }

  // A key frame is kept until 0.15 m are run; steps refer to it. Scale wanders a little around its error.
  void make_steps() {
    const auto blind = plan_.blind_spells ? spells(60, 5, 15, 0) : std::vector<Spell>{};
    const double scale = 1 + plan_.visual_scale_error * random_.normal();
    const double phase = random_.uniform(0, 6);
    int64_t reference_ns = ns(0);
    double reference_m = 0;
    for (int i = 1; i * 0.05 <= plan_.duration_s; ++i) {
      if (random_.uniform() < 0.01) continue;  // a lost picture
      const int64_t stamp_ns = ns(i * 0.05);
      const double now_m = truth_at(stamp_ns).distance_m;
      const double wander = 1 + 0.001 * std::sin(phase + now_m / 3000);
      OdometryInput step{stamp_ns, reference_ns, (now_m - reference_m) / (scale * wander), plan_.step_noise_m, true};
      step.step_m += plan_.step_noise_m * random_.normal();
      if (random_.uniform() < plan_.outlier_share) step.step_m += random_.uniform() < 0.5 ? 0.6 : -0.6;
      const bool dark = within(blind, i * 0.05) != nullptr;
      if (dark) step = {stamp_ns, reference_ns, 0, 0, false};
      events.push_back(step);
      if (dark || std::abs(now_m - reference_m) > 0.15) {
        reference_ns = stamp_ns;
        reference_m = now_m;
      }
    }
  }

  void make_pulses() {
    const auto slips = plan_.slip ? spells(60, 2, 8, 0.3) : std::vector<Spell>{};
    const double scale = 1 + plan_.wheel_scale_error * random_.normal();
    double wheel_m = random_.uniform();
    for (int i = 0; i * 0.05 <= plan_.duration_s; ++i) {
      const double t = i * 0.05;
      const double step_m = i == 0 ? 0 : truth_at(ns(t)).distance_m - truth_at(ns(t - 0.05)).distance_m;
      const auto* slip = within(slips, t);
      wheel_m += step_m / scale * (slip ? 1 + slip->size : 1);
      events.push_back(WheelInput{ns(t), static_cast<int64_t>(std::floor(wheel_m * 90)), 90});
    }
  }

  void make_inertial() {
    const double bias = 0.08 * random_.normal();
    const double gyro_bias = 0.002 * random_.normal();
    for (int i = 1; i * 0.02 <= plan_.duration_s; ++i) {
      const double t = i * 0.02;
      const auto now = truth_at(ns(t));
      const double accel = (truth_at(ns(t + 0.01)).speed_mps - truth_at(ns(t - 0.01)).speed_mps) / 0.02;
      const auto point = map->edges[0].alignment.at(kStartOffsetM + now.distance_m);
      events.push_back(ImuInput{ns(t), accel + core::kGravityMps2 * point.grade + bias + 0.2 * random_.normal(),
                                now.speed_mps * point.curvature_per_m + gyro_bias + 0.01 * random_.normal()});
    }
  }

  void make_gnss() {
    const auto outages = spells(60, 10, 40, 0);
    double east = 2 * random_.normal();
    double north = 2 * random_.normal();
    for (int i = 0; i <= plan_.duration_s; ++i) {
      east = 0.98 * east + 0.4 * random_.normal();
      north = 0.98 * north + 0.4 * random_.normal();
      const auto pose = map->edges[0].alignment.at(kStartOffsetM + truth_at(ns(i)).distance_m).pose;
      const bool none = within(outages, i) != nullptr;
      const double wild = random_.uniform() < 0.02 ? 80 : 0;
      events.push_back(GnssInput{ns(i), pose.easting_m + east + wild, pose.northing_m + north, 1.0, none ? 0 : 1});
    }
  }

  void make_fixes() {
    uint32_t id = 0;
    for (double place_m = plan_.landmark_spacing_m; place_m < truth.back().distance_m;
         place_m += plan_.landmark_spacing_m) {
      const auto passed =
          std::find_if(truth.begin(), truth.end(), [&](const TruthSample& s) { return s.distance_m > place_m; });
      const bool is_false = random_.uniform() < plan_.false_fix_share;
      const double wrong_m = is_false ? (random_.uniform() < 0.5 ? -1 : 1) * random_.uniform(3, 60) : 0;
      events.push_back(FixInput{passed->stamp_ns + core::to_ns(0.003), 1,
                                kStartOffsetM + truth_at(passed->stamp_ns + core::to_ns(0.003)).distance_m + wrong_m +
                                    0.15 * random_.normal(),
                                0.15, 0.99, ++id, FixKind::landmark, track::Direction::forward, nullptr});
    }
  }

  SimulationPlan plan_;
  core::Random random_;
};

/// Errors of one run against the truth.
struct RunErrors {
  std::vector<double> position_m;  // of every state with a known track, after `after_m`
  std::vector<double> distance_m;
  size_t states = 0;
  size_t outside = 0;  // true position not in [estimate - over, estimate + under]
  double worst_excess_m = 0;
  double budget_share = 0;  // states whose interval is within 5 m + 5 %
};

inline RunErrors run_simulation(const TrainSimulation& simulation, Fusion& fusion, double after_m = 0) {
  RunErrors errors;
  for (const auto& event : simulation.events) {
    const auto state = fusion.add(event);
    if (!state) continue;
    const auto truth = simulation.truth_at(state->stamp_ns);
    const double place_m = TrainSimulation::kStartOffsetM + truth.distance_m;
    const double error_m =
        state->track_known ? state->position.offset_m - place_m : state->distance_m - truth.distance_m;
    ++errors.states;
    const double excess_m = std::max(error_m - state->over_m, -error_m - state->under_m);
    if (excess_m > 0) {
      ++errors.outside;
      errors.worst_excess_m = std::max(errors.worst_excess_m, excess_m);
    }
    if (state->reason.find("interval wider") == std::string::npos) errors.budget_share += 1;
    if (truth.distance_m >= after_m) {
      errors.position_m.push_back(std::abs(error_m));
      errors.distance_m.push_back(std::abs(state->distance_m - truth.distance_m));
    }
  }
  errors.budget_share /= static_cast<double>(std::max<size_t>(errors.states, 1));
  return errors;
}

inline double quantile(std::vector<double> values, double share) {
  if (values.empty()) return 0;
  const auto place = static_cast<size_t>(share * static_cast<double>(values.size() - 1));
  std::nth_element(values.begin(), values.begin() + static_cast<std::ptrdiff_t>(place), values.end());
  return values[place];
}

}  // namespace railfix::fusion
