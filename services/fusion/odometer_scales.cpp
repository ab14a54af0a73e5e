#include "fusion/odometer_scales.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <map>
#include <sstream>

#include "core/time.hpp"

namespace railfix::fusion {
namespace {

constexpr double kSecondsPerDay = 86400;
constexpr double kLargestError = 0.2;

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

std::map<std::string, std::string> values_of(const std::string& text) {
  std::map<std::string, std::string> values;
  std::istringstream lines(text);
  for (std::string line; std::getline(lines, line);) {
    const size_t colon = line.find(": ");
    if (colon != std::string::npos && !line.starts_with('#')) values[line.substr(0, colon)] = line.substr(colon + 2);
  }
  return values;
}

bool possible(const OdometerScales& s) {
  const auto sigma_possible = [](double sigma) { return sigma > 0 && sigma <= kLargestError; };
  return std::abs(s.camera) < kLargestError && std::abs(s.wheel) < kLargestError && sigma_possible(s.camera_sigma) &&
         sigma_possible(s.wheel_sigma) && std::abs(s.correlation) < 1;
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
      "# True over measured metres, less 1, as references on the last trip have taught them to railfix-fusion.\n"
      "# Remove this file when a wheelset, the lens or the camera's mount has been exchanged.\n";
  char line[80];
  for (const auto& [key, member] : kNumbers) {
    std::snprintf(line, sizeof line, "%s: %.9g\n", key, saved.scales.*member);
    text += line;
  }
  std::snprintf(line, sizeof line, "pulses_per_metre: %.17g\n", saved.pulses_per_metre);
  text += line;
  return text + "stamp_ns: " + std::to_string(saved.stamp_ns) + "\ncamera_id: " + saved.camera_id + "\n";
}

core::Result<SavedScales> saved_scales(const std::string& text) {
  const auto values = values_of(text);
  SavedScales saved;
  const auto read = [&](const char* key, double& number) {
    const auto found = values.find(key);
    if (found == values.end()) return false;
    char* end = nullptr;
    number = std::strtod(found->second.c_str(), &end);
    return end != found->second.c_str() && *end == '\0' && std::isfinite(number);
  };
  bool whole = values.contains("stamp_ns") && values.contains("camera_id");
  for (const auto& [key, member] : kNumbers) whole = read(key, saved.scales.*member) && whole;
  whole = read("pulses_per_metre", saved.pulses_per_metre) && whole;
  if (!whole || !possible(saved.scales)) return core::Error{"it does not hold the scales of camera and wheel"};
  saved.stamp_ns = std::atoll(values.at("stamp_ns").c_str());
  saved.camera_id = values.at("camera_id");
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
