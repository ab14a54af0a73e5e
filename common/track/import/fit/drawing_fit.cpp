// Fits of drawings with mistakes in them: points that lie apart, stretches that are no track.
#include <algorithm>
#include <cmath>

#include "core/units.hpp"
#include "track/import/fit/biarc.hpp"
#include "track/import/fit/clothoid_fit.hpp"
#include "track/import/fit/plane.hpp"

namespace railfix::track {
namespace {

using Points = std::vector<Eigen::Vector2d>;

constexpr size_t kFewestInPart = 8;
constexpr size_t kMostInPart = 400;     // the cost of a fit grows with their third power
constexpr ptrdiff_t kBesideSplit = 15;  // points on either side that tell the track's direction there
constexpr int kMostFits = 4;
constexpr ptrdiff_t kOneOutlier = 3;  // neighbours whose error is that of the worst among them

/// Points that lie apart by more than the limit, of each group of neighbours the worst; never the first and last.
std::vector<size_t> outliers_of(const std::vector<double>& off_m, double limit_m) {
  std::vector<size_t> out;
  const auto count = static_cast<ptrdiff_t>(off_m.size());
  for (ptrdiff_t i = 1; i + 1 < count; ++i) {
    const double own = std::abs(off_m[static_cast<size_t>(i)]);
    if (!(own > limit_m)) continue;
    bool is_worst = true;
    for (ptrdiff_t k = std::max<ptrdiff_t>(0, i - kOneOutlier); k <= std::min(count - 1, i + kOneOutlier); ++k)
      is_worst = is_worst && std::abs(off_m[static_cast<size_t>(k)]) <= own;
    if (is_worst) out.push_back(static_cast<size_t>(i));
  }
  return out;
}

Points without(const Points& points, const std::vector<size_t>& outliers) {
  Points out;
  for (size_t i = 0; i < points.size(); ++i) {
    if (!std::binary_search(outliers.begin(), outliers.end(), i)) out.push_back(points[i]);
  }
  return out;
}

double distance_m(const Alignment& track, const Eigen::Vector2d& point) {
  return std::abs(track.nearest(point.x(), point.y()).lateral_m);
}

/// Leaves out what lies apart, first as its neighbours see it, then as the fit does.
std::optional<ClothoidFit> fit_without_outliers(const Points& points, const ClothoidFitOptions& options) {
  const size_t most = std::max<size_t>(1, points.size() / 10);
  Points rest = points;
  Points left_out;
  for (int attempt = 0; attempt < kMostFits; ++attempt) {
    std::vector<double> off_m;
    const double sigma_m = std::max(scatter_of(rest), options.usual_sigma_m);
    std::vector<size_t> outliers = outliers_of(apart_from_neighbours(rest), fit_limit_m(sigma_m));
    if (attempt > 0 || outliers.empty()) {
      const std::optional<ClothoidFit> fit = fit_somehow(rest, options, off_m);
      if (fit && fit->max_m < fit_limit_m(fit->sigma_m)) {
        ClothoidFit out = *fit;
        out.left_out = left_out.size();
        for (const Eigen::Vector2d& point : left_out)
          out.left_out_max_m = std::max(out.left_out_max_m, distance_m(out.alignment, point));
        return out;
      }
      if (fit) outliers = outliers_of(off_m, fit_limit_m(fit->sigma_m));
    }
    if (outliers.empty() || left_out.size() + outliers.size() > most) return std::nullopt;
    for (const size_t i : outliers) left_out.push_back(rest[i]);
    rest = without(rest, outliers);
  }
  return std::nullopt;
}

/// Where the track runs beside a point, from the points around it.
PlanPose pose_beside(const Points& points, size_t at, const ClothoidFitOptions& options) {
  const auto middle = points.begin() + static_cast<ptrdiff_t>(at);
  const Points near(middle - std::min<ptrdiff_t>(kBesideSplit, middle - points.begin()),
                    middle + std::min<ptrdiff_t>(kBesideSplit + 1, points.end() - middle));
  const auto fit =
      fit_clothoids(near, {.heading_at_start = {}, .heading_at_end = {}, .usual_sigma_m = options.usual_sigma_m});
  if (fit) return fit->alignment.at(fit->alignment.nearest(middle->x(), middle->y()).offset_m).pose;
  const Eigen::Vector2d along = *(middle + 1) - *(middle - 1);
  return {middle->x(), middle->y(), heading_of(along)};
}

void append(const Alignment& part, std::vector<Element>& elements, std::vector<PlanPose>& starts) {
  elements.insert(elements.end(), part.elements().begin(), part.elements().end());
  starts.insert(starts.end(), part.starts().begin(), part.starts().end());
}

ClothoidFit as_arcs(const Points& points, const ClothoidFitOptions& options) {
  ClothoidFit out;
  out.alignment = fit_polyline(thinned(points), options.heading_at_start, options.heading_at_end).alignment;
  out.element_max_m.assign(out.alignment.elements().size(), 0.0);
  out.arcs_m = out.alignment.length_m();
  for (const Eigen::Vector2d& point : points) out.max_m = std::max(out.max_m, distance_m(out.alignment, point));
  return out;
}

ClothoidFit joined(const ClothoidFit& a, const Points& of_a, const ClothoidFit& b, const Points& of_b) {
  std::vector<Element> elements;
  std::vector<PlanPose> starts;
  append(a.alignment, elements, starts);
  append(b.alignment, elements, starts);
  ClothoidFit out;
  out.alignment = Alignment(std::move(elements), std::move(starts), {}, {});
  out.sigma_m = std::max(a.sigma_m, b.sigma_m);
  const auto in_a = static_cast<double>(of_a.size());
  const auto in_b = static_cast<double>(of_b.size());
  out.rms_m = std::sqrt((in_a * a.rms_m * a.rms_m + in_b * b.rms_m * b.rms_m) / (in_a + in_b));
  out.max_m = std::max(a.max_m, b.max_m);
  out.element_max_m = a.element_max_m;
  out.element_max_m.insert(out.element_max_m.end(), b.element_max_m.begin(), b.element_max_m.end());
  out.left_out = a.left_out + b.left_out;
  out.left_out_max_m = std::max(a.left_out_max_m, b.left_out_max_m);
  out.arcs_m = a.arcs_m + b.arcs_m;
  return out;
}

ClothoidFit fit_parts(const Points& points, const ClothoidFitOptions& options);

/// As a whole, without outliers, or in two parts.
ClothoidFit fit_part(const Points& points, const ClothoidFitOptions& options) {
  if (points.size() > kMostInPart) return fit_parts(points, options);
  if (const auto whole = fit_clothoids(points, options)) return *whole;
  if (points.size() >= kFewestInPart) {
    if (const auto most = fit_without_outliers(points, options)) return *most;
  }
  return points.size() >= 2 * kFewestInPart ? fit_parts(points, options) : as_arcs(points, options);
}

ClothoidFit fit_parts(const Points& points, const ClothoidFitOptions& options) {
  const size_t at = points.size() / 2;
  const PlanPose pose = pose_beside(points, at, options);
  const Eigen::Vector2d meeting(pose.easting_m, pose.northing_m);
  Points first(points.begin(), points.begin() + static_cast<ptrdiff_t>(at));
  Points second(points.begin() + static_cast<ptrdiff_t>(at), points.end());
  first.push_back(meeting);
  second.front() = meeting;
  ClothoidFitOptions of_first = options;
  ClothoidFitOptions of_second = options;
  of_first.heading_at_end = of_second.heading_at_start = pose.heading_rad;
  return joined(fit_part(first, of_first), first, fit_part(second, of_second), second);
}

}  // namespace

std::optional<ClothoidFit> fit_drawing(const Points& points, const ClothoidFitOptions& options) {
  if (points.size() < 2) return std::nullopt;
  ClothoidFit fit = fit_part(points, options);
  // What is mostly arcs through the points is better left to them altogether.
  if (!(fit.arcs_m < 0.5 * fit.alignment.length_m())) return std::nullopt;
  return fit;
}

}  // namespace railfix::track
