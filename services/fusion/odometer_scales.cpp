#include "fusion/odometer_scales.hpp"

#include <yaml-cpp/yaml.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>

#include "core/time.hpp"

namespace railfix::fusion {
namespace {

constexpr double kSecondsPerDay = 86400;
constexpr double kLargestError = 0.2;
constexpr double kLargestLagS = 2.0;

// The numbers of the file; one list for both ways.
struct Number {
  const char* key;
  double OdometerScales::*member;
};
constexpr std::array<Number, 5> kNumbers{{{"camera", &OdometerScales::camera},
                                          {"camera_sigma", &OdometerScales::camera_sigma},
                                          {"wheel", &OdometerScales::wheel},
                                          {"wheel_sigma", &OdometerScales::wheel_sigma},
                                          {"correlation", &OdometerScales::correlation}}};

core::Result<YAML::Node> values_of(const std::string& text) {
  // A number that is cut is a number still, and a shorter camera_id is that of another camera: only the end tells.
  if (!text.ends_with('\n')) return core::Error{"its last line is cut off"};
  try {
    YAML::Node values = YAML::Load(text);
    if (values.IsMap()) return values;
    return core::Error{"it holds no 'key: value' lines"};
  } catch (const YAML::Exception& problem) {
    return core::Error{"line " + std::to_string(problem.mark.line + 1) + " is not YAML: " + problem.msg};
  }
}

bool possible(const SavedScales& saved) {
  const OdometerScales& s = saved.scales;
  const auto sigma_possible = [](double sigma) { return sigma > 0 && sigma <= kLargestError; };
  return std::abs(s.camera) < kLargestError && std::abs(s.wheel) < kLargestError && sigma_possible(s.camera_sigma) &&
         sigma_possible(s.wheel_sigma) && std::abs(s.correlation) < 1 && saved.stamp_ns >= 0 &&
         saved.pulses_per_metre >= 0 &&
         (!saved.camera_lag || (std::abs(saved.camera_lag->late_s) < kLargestLagS && saved.camera_lag->sigma_s > 0));
}

double aged_sigma(double sigma, double trip_sigma, double days, const FusionParameters& p, double unlearnt_sigma) {
  const double changed = std::hypot(trip_sigma, p.scale_sigma_per_day * days);
  return std::min(std::hypot(sigma, changed), unlearnt_sigma);
}

}  // namespace

OdometerScales unlearnt_scales(const FusionParameters& parameters) {
  return {.camera_sigma = parameters.visual_scale_sigma, .wheel_sigma = parameters.wheel_scale_sigma};
}

std::string to_text(const SavedScales& saved) {
  std::string text =
      "# True over measured metres, less 1, as references on the last trip have taught them to railfix-fusion;\n"
      "# camera_lag_s: how late the camera's stamps are against the wheel's.\n"
      "# Remove this file when a wheelset, the lens or the camera's mount has been exchanged.\n";
  char line[80];
  for (const auto& [key, member] : kNumbers) {
    std::snprintf(line, sizeof line, "%s: %.9g\n", key, saved.scales.*member);
    text += line;
  }
  std::snprintf(line, sizeof line, "pulses_per_metre: %.17g\n", saved.pulses_per_metre);
  text += line;
  if (saved.camera_lag) {
    std::snprintf(line, sizeof line, "camera_lag_s: %.6g\ncamera_lag_sigma_s: %.6g\n", saved.camera_lag->late_s,
                  saved.camera_lag->sigma_s);
    text += line;
  }
  return text + "stamp_ns: " + std::to_string(saved.stamp_ns) + "\ncamera_id: " + saved.camera_id + "\n";
}

core::Result<SavedScales> saved_scales(const std::string& text) {
  const auto read = values_of(text);
  if (!read.ok()) return read.error();
  const YAML::Node& values = read.value();  // const: a look-up adds nothing
  SavedScales saved;
  std::string wrong;
  const auto number = [&]<class T>(const char* key, T& value) {
    const YAML::Node node = values[key];
    const bool is_number = node.IsDefined() && node.IsScalar() && YAML::convert<T>::decode(node, value);
    if (!is_number || !std::isfinite(static_cast<double>(value))) wrong = key;
  };
  for (const auto& [key, member] : kNumbers) number(key, saved.scales.*member);
  number("pulses_per_metre", saved.pulses_per_metre);
  number("stamp_ns", saved.stamp_ns);
  if (values["camera_lag_s"].IsDefined()) {
    saved.camera_lag.emplace();
    number("camera_lag_s", saved.camera_lag->late_s);
    number("camera_lag_sigma_s", saved.camera_lag->sigma_s);
  }
  const YAML::Node camera_id = values["camera_id"];
  if (camera_id.IsDefined() && camera_id.IsScalar()) {
    saved.camera_id = camera_id.Scalar();
  } else if (!camera_id.IsDefined() || !camera_id.IsNull()) {
    return core::Error{"camera_id is missing or no text"};
  }
  if (!wrong.empty()) return core::Error{wrong + " is missing or no number"};
  if (!possible(saved)) return core::Error{"its numbers are none that an odometer has"};
  return saved;
}

OdometerScales aged(const SavedScales& saved, int64_t stamp_ns, const FusionParameters& p) {
  // Whichever was earlier: clocks of trains are set, and recordings are played.
  const double days = std::abs(core::seconds(stamp_ns - saved.stamp_ns)) / kSecondsPerDay;
  OdometerScales scales = saved.scales;
  scales.camera_sigma = aged_sigma(scales.camera_sigma, p.visual_scale_trip_sigma, days, p, p.visual_scale_sigma);
  scales.wheel_sigma = aged_sigma(scales.wheel_sigma, p.wheel_scale_trip_sigma, days, p, p.wheel_scale_sigma);
  const double known_before = saved.scales.camera_sigma * saved.scales.wheel_sigma;
  scales.correlation *= std::min(1.0, known_before / (scales.camera_sigma * scales.wheel_sigma));
  return scales;
}

}  // namespace railfix::fusion
