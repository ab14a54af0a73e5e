#include "track/import/xml/railml_plane.hpp"

#include <algorithm>
#include <array>
#include <cmath>

#include "track/import/local_crs.hpp"
#include "track/import/swapped.hpp"
#include "track/import/xml/rail_net.hpp"

namespace railfix::track {

std::string epsg_number(const std::string& text) {
  const auto last = text.find_last_not_of("0123456789");
  return last == std::string::npos ? text : text.substr(last + 1);
}

bool is_geographic(const std::string& system) {
  constexpr std::array kNames = {"WGS84", "WGS 84", "ETRS89"};
  if (std::ranges::find(kNames, system) != kNames.end()) return true;
  const std::string number = epsg_number(system);
  const bool is_epsg = system.find("EPSG") != std::string::npos || system.find("epsg") != std::string::npos;
  return is_epsg && (number == "4326" || number == "4258");
}

void RailmlPlane::choose(const pugi::xml_node& coordinate, const std::string& system, const GeoPoint& middle) {
  system_ = system;
  crs_ = is_geographic(system) ? local_crs(middle) : system;
  const auto opened = Projection::open(crs_);
  if (!opened.ok()) throw source_.wrong(coordinate, opened.error().message);
  if (is_geographic(system)) projection_ = opened.value();
}

Eigen::Vector2d RailmlPlane::at(const pugi::xml_node& coordinate, const std::string& system, double first,
                                double second) {
  const std::string element = "<" + std::string(coordinate.name()) + ">";
  if (is_geographic(system) && !is_on_earth({first, second})) {
    throw source_.wrong(coordinate, element + " says latitude " + std::to_string(first) + " and longitude " +
                                        std::to_string(second) + "; they go from -90 to 90 and from -180 to 180" +
                                        (may_be_swapped({first, second}) ? std::string(": ") + kMayBeSwapped : ""));
  }
  if (crs_.empty()) choose(coordinate, system, {first, second});
  if (system != system_) {
    throw source_.wrong(coordinate,
                        "coordinates in both " + system_ + " and " + system + "; only one system can be read");
  }
  if (!projection_) {
    if (!is_place({first, second})) throw source_.wrong(coordinate, element + " has " + kNoPlace);
    return {first, second};
  }
  const auto at = projection_->from_geo({first, second});
  if (!at) throw source_.wrong(coordinate, element + " lies too far from the first one of the file");
  return *at;
}

}  // namespace railfix::track
