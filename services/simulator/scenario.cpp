#include "simulator/scenario.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <sstream>

#include "core/random.hpp"
#include "core/time.hpp"
#include "core/units.hpp"
#include "simulator/illumination.hpp"

namespace railfix::simulator {
namespace {

constexpr double kRampS = 0.5;
constexpr double kRampM = 5.0;
constexpr double kMeterAheadM = 8.0;  // where the camera measures the light
constexpr double kMeterS = 2.0;
constexpr double kMeterStepS = 0.1;
constexpr double kMostJitter = 0.4;  // of the time between pictures

double ramp(double inside, double length) {
  return std::clamp(inside / length + 1.0, 0.0, 1.0);
}

// First-order lag behind the light over the last two seconds.
double metered_gain(const Scenario& scenario, const Trajectory& trajectory, double time_s) {
  const auto& exposure = scenario.options().exposure;
  double gain = 0.0;
  double weights = 0.0;
  for (double back_s = 0.0; back_s < kMeterS; back_s += kMeterStepS) {
    const double then_s = std::max(0.0, time_s - back_s);
    const double distance_m = trajectory.motion(then_s).distance_m;
    const Look look = scenario.look(then_s, distance_m);
    const Illumination light(trajectory.line(), look.light, distance_m);
    const auto level = light.on_ground(kMeterAheadM, kMeterAheadM, 0.0F);
    const double bright =
        static_cast<double>(level.diffuse) + static_cast<double>(level.direct) * (1.0 - 0.5 * look.shadows);
    const double weight = std::exp(-back_s / std::max(exposure.adapt_s, 1e-3));
    gain += weight * std::min(exposure.most_gain, 1.0 / std::max(bright, 1e-3));
    weights += weight;
  }
  return gain / weights;
}

}  // namespace

core::Result<When> When::parse(const std::string& text) {
  When when;
  if (text == "never") return when;
  when.always_ = text == "always";
  std::istringstream parts(text);
  for (std::string part; !when.always_ && std::getline(parts, part, ',');) {
    // "10..20 s": the dots would pass for the number's own.
    const auto dots = part.find("..");
    Stretch stretch{};
    char unit = 0;
    char rest = 0;
    if (dots == std::string::npos || std::sscanf(part.substr(0, dots).c_str(), "%lf %c", &stretch.begin, &rest) != 1 ||
        std::sscanf(part.substr(dots + 2).c_str(), "%lf %c %c", &stretch.end, &unit, &rest) != 2 ||
        (unit != 's' && unit != 'm') || !(stretch.begin < stretch.end)) {
      return core::Error{"'" + text + "' is not always, never or stretches like '10..20 s, 300..450 m'"};
    }
    stretch.time = unit == 's';
    when.stretches_.push_back(stretch);
  }
  if (!when.always_ && when.stretches_.empty()) return core::Error{"is empty; write always, never or '10..20 s'"};
  return when;
}

double When::strength(double time_s, double distance_m) const {
  double most = always_ ? 1.0 : 0.0;
  for (const auto& stretch : stretches_) {
    const double at = stretch.time ? time_s : distance_m;
    const double length = stretch.time ? kRampS : kRampM;
    most = std::max(most, std::min(ramp(at - stretch.begin - length, length), ramp(stretch.end - at - length, length)));
  }
  return most;
}

core::Result<Scenario> Scenario::make(const ScenarioOptions& options, uint64_t seed) {
  Scenario scenario;
  scenario.options_ = options;
  scenario.seed_ = seed;
  struct Text {
    const char* key;
    const std::string& text;
    When& when;
  };
  for (const auto& one : {Text{"light.sun_when", options.light.sun_when, scenario.sun_},
                          Text{"shadows.when", options.shadows.when, scenario.shadows_},
                          Text{"rain.when", options.rain.when, scenario.rain_},
                          Text{"leaves.when", options.leaves.when, scenario.leaves_},
                          Text{"windscreen.drops_when", options.windscreen.drops_when, scenario.drops_},
                          Text{"windscreen.wiper_when", options.windscreen.wiper_when, scenario.wiper_},
                          Text{"frames.drop_when", options.frames.drop_when, scenario.drop_frames_}}) {
    auto when = When::parse(one.text);
    if (!when.ok()) return core::Error{"simulator." + std::string(one.key) + " " + when.error().message};
    one.when = std::move(when).value();
  }
  return scenario;
}

Look Scenario::look(double time_s, double distance_m) const {
  const auto now = [&](const When& when) { return when.strength(time_s, distance_m); };
  Look look;
  const auto& light = options_.light;
  look.light = {light.sky,
                light.dome,
                light.sun * now(sun_),
                core::rad_from_deg(light.sun_elevation_deg),
                core::rad_from_deg(light.sun_heading_deg),
                light.headlamp,
                light.haze_m};
  look.time_s = time_s;
  look.shadows = options_.shadows.depth * now(shadows_);
  look.wet = options_.rain.wet;
  look.rain = options_.rain.intensity * now(rain_);
  look.leaves = options_.leaves.intensity * now(leaves_);
  look.drops = options_.windscreen.drops * now(drops_);
  look.dirt = options_.windscreen.dirt;
  look.wiping = now(wiper_) > 0.5;
  return look;
}

double Scenario::gain(const Trajectory& trajectory, double time_s) const {
  const auto& exposure = options_.exposure;
  double gain = metered_gain(*this, trajectory, time_s);
  if (exposure.step > 0.0) gain = std::exp(std::round(std::log(gain) / exposure.step) * exposure.step);
  const double phase = 6.28 * static_cast<double>(unit_float(mix_bits(seed_, 8)));
  return gain * (1.0 + exposure.wander * (std::sin(0.31 * time_s + phase) + std::sin(1.13 * time_s + 2.0 * phase)));
}

std::vector<Exposure> Scenario::exposures(const Trajectory& trajectory, double rate_hz) const {
  const auto& frames = options_.frames;
  std::vector<Exposure> all;
  int64_t dropped_until = 0;
  for (int64_t k = 0; static_cast<double>(k) / rate_hz <= trajectory.duration_s(); ++k) {
    const double time_s = static_cast<double>(k) / rate_hz;
    const double share = frames.drop_share * drop_frames_.strength(time_s, trajectory.motion(time_s).distance_m);
    const bool begins =
        static_cast<double>(unit_float(mix_bits(seed_, k, 9))) * static_cast<double>(frames.drop_run) < share;
    if (k > 0 && begins) dropped_until = std::max(dropped_until, k + frames.drop_run);
    core::Random random(mix_bits(seed_, k, 10));
    const double most = kMostJitter / rate_hz;
    const double late_s = std::clamp(random.normal() * frames.jitter_s, -most, most);
    const int64_t exposed_ns = trajectory.begin_ns() + core::to_ns(time_s);
    all.push_back({exposed_ns + core::to_ns(late_s), exposed_ns, k < dropped_until});
  }
  return all;
}

}  // namespace railfix::simulator
