#include "track/import/xml/net_plan.hpp"

#include <algorithm>
#include <cmath>

#include "track/import/told.hpp"

namespace railfix::track {
namespace {

constexpr double kBorneOutM = 0.25;  // coordinates that are computed from the plan lie within centimetres of it

Eigen::Vector2d end_of(const Alignment& track) {
  const PlanPose end = track.at(track.length_m()).pose;
  return {end.easting_m, end.northing_m};
}

/// Clockwise from north.
double heading_rad(const Eigen::Vector2d& way) {
  return std::atan2(way.x(), way.y());
}

/// To the scale of the plane, so that it ends where the points do.
std::vector<Element> scaled(std::vector<Element> elements, double scale) {
  for (Element& element : elements) {
    element.length_m *= scale;
    element.curvature_start_per_m /= scale;
    element.curvature_end_per_m /= scale;
  }
  return elements;
}

Alignment laid_along(const std::vector<Element>& elements, const std::vector<Eigen::Vector2d>& points) {
  const Eigen::Vector2d& begin = points.front();
  const Eigen::Vector2d way = points.back() - begin;
  const Alignment north = Alignment::chained({begin.x(), begin.y(), 0}, elements);
  const Eigen::Vector2d north_way = end_of(north) - begin;
  const double scale = north_way.norm() > 0 ? way.norm() / north_way.norm() : 1;
  const double turn_rad = heading_rad(way) - heading_rad(north_way);
  const bool is_near = std::abs(scale - 1) * north.length_m() < kBorneOutM;
  return Alignment::chained({begin.x(), begin.y(), turn_rad}, is_near ? scaled(elements, scale) : elements);
}

/// The coordinates of both ends say nothing of the way between them.
bool needs_more_points(const NetTrack& track) {
  return track.shape.size() < 3 && std::ranges::any_of(track.plan, [](const Element& element) {
           return element.curvature_start_per_m != 0 || element.curvature_end_per_m != 0;
         });
}

}  // namespace

std::optional<ClothoidFit> own_plan(const NetTrack& track, std::vector<std::string>& problems) {
  if (track.plan.empty()) return std::nullopt;
  if (needs_more_points(track)) {
    problems.push_back("track " + track.track.name +
                       " has the coordinates of its ends alone, which do not bear out its arcs; it is straight");
    return std::nullopt;
  }
  ClothoidFit out;
  out.alignment = laid_along(track.plan, track.shape);
  out.element_max_m.resize(track.plan.size());
  double squares = 0;
  for (const Eigen::Vector2d& point : track.shape) {
    const Alignment::Nearest nearest = out.alignment.nearest(point.x(), point.y());
    const auto& offsets = out.alignment.element_offsets();
    const auto next =
        std::ranges::upper_bound(offsets.begin() + 1, offsets.begin() + std::ssize(track.plan), nearest.offset_m);
    double& worst_m = out.element_max_m[static_cast<size_t>(next - offsets.begin() - 1)];
    worst_m = std::max(worst_m, std::abs(nearest.lateral_m));
    squares += nearest.lateral_m * nearest.lateral_m;
  }
  out.max_m = *std::ranges::max_element(out.element_max_m);
  out.rms_m = out.sigma_m = std::sqrt(squares / static_cast<double>(track.shape.size()));
  const double end_m = (end_of(out.alignment) - track.shape.back()).norm();
  if (std::max(out.max_m, end_m) <= kBorneOutM) return out;
  problems.push_back("track " + track.track.name + " has coordinates up to " + told_m(std::max(out.max_m, end_m)) +
                     " off the straights and arcs that are said of it; it follows the coordinates");
  return std::nullopt;
}

}  // namespace railfix::track
