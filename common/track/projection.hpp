// Map coordinates <-> WGS 84 by PROJ.
#pragma once

#include <Eigen/Core>
#include <memory>
#include <optional>
#include <string>

#include "core/result.hpp"

namespace railfix::track {

struct GeoPoint {
  double lat_deg = 0;
  double lon_deg = 0;
};

/// One PROJ context of its own: many may run in as many threads, one must stay in one thread at a time.
class Projection {
 public:
  /// crs as PROJ knows it ("EPSG:2056"); must be a projected one in metres, or one whose plane is that.
  static core::Result<Projection> open(const std::string& crs);

  /// Nothing where the projection is not defined.
  [[nodiscard]] std::optional<GeoPoint> to_geo(double easting_m, double northing_m) const;
  [[nodiscard]] std::optional<Eigen::Vector2d> from_geo(const GeoPoint& point) const;
  /// False where the system is made for other places, so many degrees beyond its area; true where nobody says for
  /// which.
  [[nodiscard]] bool is_made_for(const GeoPoint& point, double beyond_deg = 0) const;

 private:
  struct Handle;
  explicit Projection(std::shared_ptr<Handle> handle) : handle_(std::move(handle)) {}
  std::shared_ptr<Handle> handle_;
};

/// "EPSG:326xx" or "EPSG:327xx" of the point's UTM zone.
std::string utm_crs(const GeoPoint& point);

}  // namespace railfix::track
