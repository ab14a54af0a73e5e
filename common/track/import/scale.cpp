#include "track/import/scale.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>

#include "core/units.hpp"

namespace railfix::track {
namespace {

constexpr double kMostMPerKm = 0.5;
constexpr double kEveryM = 1000;
constexpr double kStepDeg = 1e-4;  // 11 m

// WGS 84
constexpr double kSemiMajorM = 6378137;
constexpr double kEccentricity2 = 0.00669437999014;

/// Map metres per true metre to the north and to the east of a place; not finite where there is no such place.
std::array<double, 2> scales_at(const Map& map, double easting_m, double northing_m) {
  const std::optional<GeoPoint> place = map.to_geo(easting_m, northing_m);
  if (!place) return {NAN, NAN};
  const auto length_m = [&](double lat_step_deg, double lon_step_deg) {
    const auto from = map.from_geo({place->lat_deg - 0.5 * lat_step_deg, place->lon_deg - 0.5 * lon_step_deg});
    const auto to = map.from_geo({place->lat_deg + 0.5 * lat_step_deg, place->lon_deg + 0.5 * lon_step_deg});
    return from && to ? (*to - *from).norm() : NAN;
  };
  const double lat_rad = core::rad_from_deg(place->lat_deg);
  const double flatter = 1.0 - kEccentricity2 * std::pow(std::sin(lat_rad), 2);
  const double north_m = kSemiMajorM * (1.0 - kEccentricity2) / std::pow(flatter, 1.5) * core::rad_from_deg(kStepDeg);
  const double east_m = kSemiMajorM / std::sqrt(flatter) * std::cos(lat_rad) * core::rad_from_deg(kStepDeg);
  return {length_m(kStepDeg, 0) / north_m, length_m(0, kStepDeg) / east_m};
}

}  // namespace

std::optional<ScaleRange> scale_over(const Map& map) {
  if (map.crs.empty()) return std::nullopt;
  std::optional<ScaleRange> range;
  for (const Edge& edge : map.edges) {
    const double steps = std::ceil(edge.alignment.length_m() / kEveryM);
    for (double step = 0; step <= steps; ++step) {
      const PlanPose pose = edge.alignment.at(edge.alignment.length_m() * step / std::max(steps, 1.0)).pose;
      for (const double scale : scales_at(map, pose.easting_m, pose.northing_m)) {
        if (!std::isfinite(scale)) continue;
        const double m_per_km = 1000.0 * (scale - 1.0);
        if (!range) range = {m_per_km, m_per_km};
        range->least_m_per_km = std::min(range->least_m_per_km, m_per_km);
        range->most_m_per_km = std::max(range->most_m_per_km, m_per_km);
      }
    }
  }
  return range;
}

std::string scale_problem(const Map& map) {
  const std::optional<ScaleRange> range = scale_over(map);
  if (!range || (range->least_m_per_km >= -kMostMPerKm && range->most_m_per_km <= kMostMPerKm)) return "";
  std::array<char, 240> text{};
  std::snprintf(
      text.data(), text.size(),
      "lengths on the map are off by %+.2f to %+.2f m per km, more than %.1f: give another --crs (local is true "
      "in the middle of OpenStreetMap data), or cut the data into maps that are less wide",
      range->least_m_per_km, range->most_m_per_km, kMostMPerKm);
  return text.data();
}

}  // namespace railfix::track
