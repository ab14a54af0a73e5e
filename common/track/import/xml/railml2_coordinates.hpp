// Coordinates in railML 2: <geoCoord> at what lies on a track's axis, and at <geoMapping>.
#pragma once

#include <string>
#include <vector>

#include "track/import/xml/rail_net.hpp"
#include "track/import/xml/railml_plane.hpp"

namespace railfix::track {

/// Latitude before longitude (EPSG:4326, the default, and EPSG:4258), easting before northing in all other systems.
class Railml2Coordinates {
 public:
  struct Point {
    double offset_m = 0;
    Eigen::Vector2d at{0, 0};
  };

  explicit Railml2Coordinates(const XmlSource& source);
  /// Of one <track>, by offset from its begin at mileage `origin_m`. Throws core::BadInput where a file mixes systems.
  std::vector<Point> points_of(const pugi::xml_node& track, double origin_m);
  /// Of the plane; empty without coordinates.
  [[nodiscard]] const std::string& crs() const { return plane_.crs(); }

 private:
  [[nodiscard]] Eigen::Vector2d in_plane(const pugi::xml_node& coordinate);

  const XmlSource& source_;
  std::string default_code_;
  RailmlPlane plane_;
};

/// The points as the shape of a stretch of the track, its ends between points interpolated. Empty where the points do
/// not reach both ends, or where the way along them is not as long as the stretch: then `why` says so.
std::vector<Eigen::Vector2d> shape_between(const std::vector<Railml2Coordinates::Point>& points, double from_m,
                                           double to_m, std::string& why);

}  // namespace railfix::track
