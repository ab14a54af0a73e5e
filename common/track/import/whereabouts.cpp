#include "track/import/whereabouts.hpp"

#include <algorithm>
#include <cmath>

#include "core/units.hpp"
#include "track/import/swapped.hpp"
#include "track/import/told.hpp"

namespace railfix::track {
namespace {

constexpr double kEarthKm = 6371.0;
constexpr double kApartKm = 500.0;    // no plane is true to scale so far from its middle
constexpr double kNearerShare = 0.2;  // who would lie so much nearer the other way round may be swapped
constexpr double kBeyondDeg = 1.0;    // lines run on across the border of a zone

/// Of the tracks that have coordinates.
std::optional<Eigen::Vector2d> middle_of(const Map& map) {
  Eigen::Vector2d sum = Eigen::Vector2d::Zero();
  double length_m = 0;
  for (const Edge& edge : map.edges) {
    if (edge.is_drawn) continue;
    const double of_edge_m = edge.alignment.length_m();
    const PlanPose pose = edge.alignment.at(0.5 * of_edge_m).pose;
    sum += of_edge_m * Eigen::Vector2d(pose.easting_m, pose.northing_m);
    length_m += of_edge_m;
  }
  return length_m > 0 ? std::optional<Eigen::Vector2d>(sum / length_m) : std::nullopt;
}

std::string told_around(const std::string& place, const std::string& crs) {
  return "the tracks lie around " + place + ", for which " + crs + " is not made";
}

/// On the sphere.
double km_between(const GeoPoint& a, const GeoPoint& b) {
  const auto unit = [](const GeoPoint& place) {
    const double lat = core::rad_from_deg(place.lat_deg);
    const double lon = core::rad_from_deg(place.lon_deg);
    return Eigen::Vector3d(std::cos(lat) * std::cos(lon), std::cos(lat) * std::sin(lon), std::sin(lat));
  };
  return kEarthKm * 2 * std::asin(std::min(1.0, 0.5 * (unit(a) - unit(b)).norm()));
}

std::string told_roughly(const GeoPoint& place) {
  return "latitude " + told_number(place.lat_deg, 3) + ", longitude " + told_number(place.lon_deg, 3);
}

}  // namespace

std::string told_swapped(const GeoPoint& middle, const Projection& projection, const std::string& crs) {
  if (projection.is_made_for(middle) || !projection.is_made_for(swapped(middle))) return "";
  return told_around(told_roughly(middle), crs) + ", and would lie right the other way round: " + kMayBeSwapped;
}

std::optional<GeoPoint> middle_on_earth(const Map& map) {
  const auto middle = map.crs.empty() ? std::nullopt : middle_of(map);
  if (!middle) return std::nullopt;
  const auto opened = Projection::open(map.crs);
  return opened.ok() ? opened.value().to_geo(middle->x(), middle->y()) : std::nullopt;
}

std::vector<std::string> told_apart(const std::vector<InputPlace>& inputs) {
  std::vector<std::string> told;
  for (auto input = inputs.begin(); input != inputs.end(); ++input) {
    const auto away_km = [&](const InputPlace& other) { return km_between(input->middle, other.middle); };
    const auto nearest = std::ranges::min_element(inputs.begin(), input, {}, away_km);
    if (nearest == input || away_km(*nearest) < kApartKm) continue;
    const GeoPoint turned = swapped(input->middle);
    const double turned_km = is_on_earth(turned) ? km_between(turned, nearest->middle) : away_km(*nearest);
    const std::string said = "the tracks of " + input->name + " lie around " + told_roughly(input->middle) + ", " +
                             told_number(away_km(*nearest), 0) + " km from those of " + nearest->name;
    told.push_back(turned_km < kNearerShare * away_km(*nearest)
                       ? said + ", and would lie " + told_number(turned_km, 0) +
                             " km from them the other way round: " + kMayBeSwapped + " in one of the two"
                       : said + ": do they belong on one map?");
  }
  return told;
}

std::string whereabouts_problem(const Map& map) {
  const auto middle = map.crs.empty() ? std::nullopt : middle_of(map);
  if (!middle) return "";
  const auto opened = Projection::open(map.crs);
  if (!opened.ok()) return "";
  const Projection& projection = opened.value();
  const auto fits = [&](const std::optional<GeoPoint>& place) {
    return place && projection.is_made_for(*place, kBeyondDeg);
  };
  const auto place = projection.to_geo(middle->x(), middle->y());
  if (std::string told = place ? told_swapped(*place, projection, map.crs) : ""; !told.empty()) return told;
  if (fits(place)) return "";
  const bool fits_exchanged = fits(projection.to_geo(middle->y(), middle->x()));
  const std::string around =
      place ? told_roughly(*place) : "easting " + told_m(middle->x(), 0) + ", northing " + told_m(middle->y(), 0);
  return told_around(around, map.crs) + ": " +
         (fits_exchanged ? "eastings and northings are exchanged, and the map is a mirror image"
                         : "the coordinates are of another system, or eastings and northings are exchanged");
}

}  // namespace railfix::track
