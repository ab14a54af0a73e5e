#include "track/projection.hpp"

#include <proj.h>

#include <algorithm>
#include <cmath>

namespace railfix::track {
namespace {

using Owned = std::unique_ptr<PJ, decltype(&proj_destroy)>;

/// The plane's own system: without heights, and without what leads from it to another datum.
Owned horizontal(PJ_CONTEXT* context, const char* crs) {
  Owned system(proj_create(context, crs), &proj_destroy);
  while (system) {
    const PJ_TYPE type = proj_get_type(system.get());
    if (type == PJ_TYPE_BOUND_CRS) {
      system.reset(proj_get_source_crs(context, system.get()));
    } else if (type == PJ_TYPE_COMPOUND_CRS) {
      system.reset(proj_crs_get_sub_crs(context, system.get(), 0));
    } else {
      break;
    }
  }
  return system;
}

bool is_plane_in_metres(PJ_CONTEXT* context, const char* crs) {
  const Owned system = horizontal(context, crs);
  if (!system || proj_get_type(system.get()) != PJ_TYPE_PROJECTED_CRS) return false;
  const Owned axes(proj_crs_get_coordinate_system(context, system.get()), &proj_destroy);
  if (!axes) return false;
  for (const int axis : {0, 1}) {
    double metres = 0;
    if (proj_cs_get_axis_info(context, axes.get(), axis, nullptr, nullptr, nullptr, &metres, nullptr, nullptr,
                              nullptr) == 0)
      return false;
    if (metres != 1.0) return false;
  }
  return true;
}

}  // namespace

struct Projection::Handle {
  PJ_CONTEXT* context = proj_context_create();
  PJ* map_from_geo = nullptr;
  bool has_area = false;
  GeoPoint south_west;
  GeoPoint north_east;

  Handle() { proj_log_level(context, PJ_LOG_NONE); }
  ~Handle() {
    proj_destroy(map_from_geo);
    proj_context_destroy(context);
  }
  Handle(const Handle&) = delete;
  Handle& operator=(const Handle&) = delete;
};

core::Result<Projection> Projection::open(const std::string& crs) {
  auto handle = std::make_shared<Handle>();
  const core::Error unknown{"\"" + crs +
                            "\" is not a coordinate system in metres that PROJ knows; give one such as EPSG:2056"};
  if (!is_plane_in_metres(handle->context, crs.c_str())) return unknown;
  PJ* raw = proj_create_crs_to_crs(handle->context, "EPSG:4326", crs.c_str(), nullptr);
  if (raw == nullptr) return unknown;
  const Owned system = horizontal(handle->context, crs.c_str());
  handle->has_area =
      proj_get_area_of_use(handle->context, system.get(), &handle->south_west.lon_deg, &handle->south_west.lat_deg,
                           &handle->north_east.lon_deg, &handle->north_east.lat_deg, nullptr) != 0 &&
      handle->south_west.lon_deg <= handle->north_east.lon_deg;  // else over the date line, or unknown
  // Easting before northing and longitude before latitude, whatever order the authority of the system wrote down.
  handle->map_from_geo = proj_normalize_for_visualization(handle->context, raw);
  proj_destroy(raw);
  if (handle->map_from_geo == nullptr) return unknown;
  return Projection(std::move(handle));
}

std::optional<GeoPoint> Projection::to_geo(double easting_m, double northing_m) const {
  const PJ_COORD out = proj_trans(handle_->map_from_geo, PJ_INV, proj_coord(easting_m, northing_m, 0, 0));
  if (!std::isfinite(out.xy.x) || !std::isfinite(out.xy.y)) return std::nullopt;
  return GeoPoint{.lat_deg = out.xy.y, .lon_deg = out.xy.x};
}

std::optional<Eigen::Vector2d> Projection::from_geo(const GeoPoint& point) const {
  const PJ_COORD out = proj_trans(handle_->map_from_geo, PJ_FWD, proj_coord(point.lon_deg, point.lat_deg, 0, 0));
  if (!std::isfinite(out.xy.x) || !std::isfinite(out.xy.y)) return std::nullopt;
  return Eigen::Vector2d(out.xy.x, out.xy.y);
}

bool Projection::is_made_for(const GeoPoint& point, double beyond_deg) const {
  const auto is_within = [&](double GeoPoint::*degrees) {
    return point.*degrees >= handle_->south_west.*degrees - beyond_deg &&
           point.*degrees <= handle_->north_east.*degrees + beyond_deg;
  };
  return !handle_->has_area || (is_within(&GeoPoint::lat_deg) && is_within(&GeoPoint::lon_deg));
}

std::string utm_crs(const GeoPoint& point) {
  const int zone = std::clamp(static_cast<int>(std::floor((point.lon_deg + 180.0) / 6.0)) + 1, 1, 60);
  return "EPSG:" + std::to_string((point.lat_deg < 0 ? 32700 : 32600) + zone);
}

}  // namespace railfix::track
