// The plane that a railML file's coordinates are put into.
#pragma once

#include <optional>
#include <string>

#include "track/import/xml/xml_source.hpp"
#include "track/projection.hpp"

namespace railfix::track {

/// Geographic coordinates (EPSG:4326 and EPSG:4258) are put into a plane that is true to scale around the first of
/// them; projected ones stay as they are.
class RailmlPlane {
 public:
  explicit RailmlPlane(const XmlSource& source) : source_(source) {}
  /// Latitude and longitude where the system is geographic, else easting and northing. Throws core::BadInput where a
  /// file mixes systems.
  [[nodiscard]] Eigen::Vector2d at(const pugi::xml_node& coordinate, const std::string& system, double first,
                                   double second);
  /// Of the plane; empty without coordinates.
  [[nodiscard]] const std::string& crs() const { return crs_; }

 private:
  void choose(const pugi::xml_node& coordinate, const std::string& system, const GeoPoint& middle);

  const XmlSource& source_;
  std::string system_;  // of the first coordinate
  std::string crs_;
  std::optional<Projection> projection_;  // of geographic ones
};

/// "EPSG:4326", "urn:ogc:def:crs:EPSG::4326", "https://www.opengis.net/def/crs/EPSG/0/4326", EPSG:4258 likewise, and
/// the names WGS84 and ETRS89.
bool is_geographic(const std::string& system);

/// Digits at the end of "4326" and of every other spelling; empty when there are none.
std::string epsg_number(const std::string& text);

}  // namespace railfix::track
