#include "track/alignment.hpp"

#include <algorithm>
#include <array>
#include <cassert>
#include <cmath>
#include <limits>
#include <numeric>

#include "core/units.hpp"

namespace railfix::track {
namespace {

// Gauss-Legendre of eight points on [-1, 1]; its error over a panel that turns by 1 rad is below 1e-17 of the length.
constexpr std::array<double, 4> kNode{0.1834346424956498, 0.5255324099163290, 0.7966664774136267, 0.9602898564975363};
constexpr std::array<double, 4> kWeight{0.3626837833783620, 0.3137066458778873, 0.2223810344533745, 0.1012285362903763};
constexpr double kTurnPerPanelRad = 1.0;
constexpr double kMostPanels = 4096;

/// sin(x) / x
double sinc(double x) {
  return std::abs(x) < 1e-4 ? 1.0 - x * x / 6.0 : std::sin(x) / x;
}

/// Displacement along an arc: the chord has the heading of its middle.
Eigen::Vector2d arc_displacement(double heading_rad, double curvature_per_m, double distance_m) {
  const double half_turn = 0.5 * curvature_per_m * distance_m;
  const double chord = distance_m * sinc(half_turn);
  const double heading = heading_rad - half_turn;
  return {chord * std::sin(heading), chord * std::cos(heading)};
}

/// Displacement along a clothoid: quadrature of (sin, cos) of the heading, which is a parabola of the arc length.
Eigen::Vector2d clothoid_displacement(double heading_rad, double curvature, double rate, double distance_m) {
  const double most_turn = std::abs(curvature * distance_m) + 0.5 * std::abs(rate) * distance_m * distance_m;
  const double panels = std::clamp(std::ceil(most_turn / kTurnPerPanelRad), 1.0, kMostPanels);
  const double half = 0.5 * distance_m / panels;
  Eigen::Vector2d sum = Eigen::Vector2d::Zero();
  for (double panel = 0; panel < panels; ++panel) {
    const double middle = (2.0 * panel + 1.0) * half;
    for (size_t i = 0; i < kNode.size(); ++i) {
      for (const double s : {middle - half * kNode[i], middle + half * kNode[i]}) {
        const double heading = heading_rad - (curvature + 0.5 * rate * s) * s;
        sum += kWeight[i] * Eigen::Vector2d(std::sin(heading), std::cos(heading));
      }
    }
  }
  return half * sum;
}

double rate_of(const Element& element) {
  return (element.curvature_end_per_m - element.curvature_start_per_m) / element.length_m;
}

/// Index of the last point with offset <= offset_m, limited so that a successor exists. REQUIRES: two points or more.
template <class Point>
size_t span_index(const std::vector<Point>& points, double offset_m) {
  const auto after = std::upper_bound(points.begin(), points.end(), offset_m,
                                      [](double offset, const Point& point) { return offset < point.offset_m; });
  const auto index = static_cast<size_t>(std::max<ptrdiff_t>(after - points.begin() - 1, 0));
  return std::min(index, points.size() - 2);
}

double slope(const GradePoint& a, const GradePoint& b) {
  const double run = b.offset_m - a.offset_m;
  return run > 0 ? (b.elevation_m - a.elevation_m) / run : 0.0;
}

/// Elevation, grade and vertical curvature on the tangents with parabolas at the points between them.
void apply_profile(const std::vector<GradePoint>& profile, double offset_m, TrackPoint& out) {
  if (profile.empty()) return;
  if (profile.size() == 1) {
    out.elevation_m = profile.front().elevation_m;
    return;
  }
  const size_t span = span_index(profile, offset_m);
  out.grade = slope(profile[span], profile[span + 1]);
  out.elevation_m = profile[span].elevation_m + out.grade * (offset_m - profile[span].offset_m);
  for (const size_t i : {span, span + 1}) {
    const GradePoint& point = profile[i];
    const double from_middle = offset_m - point.offset_m;
    if (i == 0 || i + 1 == profile.size() || 2.0 * std::abs(from_middle) >= point.curve_length_m) continue;
    const double grade_in = slope(profile[i - 1], point);
    const double into = from_middle + 0.5 * point.curve_length_m;
    out.vertical_curvature_per_m = (slope(point, profile[i + 1]) - grade_in) / point.curve_length_m;
    out.grade = grade_in + out.vertical_curvature_per_m * into;
    out.elevation_m = point.elevation_m + grade_in * from_middle + 0.5 * out.vertical_curvature_per_m * into * into;
    return;
  }
}

void apply_cant(const std::vector<CantPoint>& cant, double offset_m, TrackPoint& out) {
  if (cant.empty()) return;
  if (offset_m <= cant.front().offset_m || cant.size() == 1) {
    out.cant_m = cant.front().cant_m;
  } else if (offset_m >= cant.back().offset_m) {
    out.cant_m = cant.back().cant_m;
  } else {
    const size_t span = span_index(cant, offset_m);
    const double run = cant[span + 1].offset_m - cant[span].offset_m;
    out.twist = run > 0 ? (cant[span + 1].cant_m - cant[span].cant_m) / run : 0.0;
    out.cant_m = cant[span].cant_m + out.twist * (offset_m - cant[span].offset_m);
  }
}

/// Nearest point of one element.
class ElementSearch {
 public:
  ElementSearch(const PlanPose& start, const Element& element, const Eigen::Vector2d& target)
      : start_(start), element_(element), target_(target) {}

  /// Distance into the element, in [0, length].
  [[nodiscard]] double best() const {
    const double sharpest =
        std::max({std::abs(element_.curvature_start_per_m), std::abs(element_.curvature_end_per_m), 1e-9});
    const double steps = std::clamp(std::ceil(element_.length_m * sharpest / kTurnPerStepRad), 1.0, 1000.0);
    const double step = element_.length_m / steps;
    double nearest = std::numeric_limits<double>::infinity();
    double nearest_s = 0;
    for (double i = 0; i <= steps; ++i) {
      const double squared = offset_from(advance(start_, element_, i * step)).squaredNorm();
      if (squared < nearest) {
        nearest = squared;
        nearest_s = i * step;
      }
    }
    return refine(std::max(nearest_s - step, 0.0), std::min(nearest_s + step, element_.length_m), nearest_s);
  }

 private:
  static constexpr double kTurnPerStepRad = 0.5;

  [[nodiscard]] Eigen::Vector2d offset_from(const PlanPose& pose) const {
    return target_ - Eigen::Vector2d(pose.easting_m, pose.northing_m);
  }

  /// The target seen from the track at s: x along it, y left of it.
  [[nodiscard]] Eigen::Vector2d seen_from(double s) const {
    const PlanPose pose = advance(start_, element_, s);
    const Eigen::Vector2d away = offset_from(pose);
    const double sine = std::sin(pose.heading_rad);
    const double cosine = std::cos(pose.heading_rad);
    return {away.x() * sine + away.y() * cosine, away.y() * sine - away.x() * cosine};
  }

  /// Newton on the target's coordinate along the track, kept inside a bracket that shrinks with every step.
  [[nodiscard]] double refine(double low, double high, double s) const {
    if (seen_from(low).x() <= 0) return low;
    if (seen_from(high).x() >= 0) return high;
    for (int step = 0; step < 60; ++step) {
      const Eigen::Vector2d seen = seen_from(s);
      (seen.x() > 0 ? low : high) = s;
      const double stretch = 1.0 - seen.y() * (element_.curvature_start_per_m + rate_of(element_) * s);
      double next = s + seen.x() / stretch;
      if (!(next > low && next < high)) next = 0.5 * (low + high);
      if (std::abs(next - s) < 1e-10) return next;
      s = next;
    }
    return s;
  }

  PlanPose start_;
  Element element_;
  Eigen::Vector2d target_;
};

}  // namespace

double bulge_m(const Element& element) {
  const double sharpest = std::max(std::abs(element.curvature_start_per_m), std::abs(element.curvature_end_per_m));
  return 0.125 * sharpest * element.length_m * element.length_m;
}

PlanPose turned_round(const PlanPose& pose) {
  return {pose.easting_m, pose.northing_m, core::wrap_pi(pose.heading_rad + core::kPi)};
}

PlanPose advance(const PlanPose& start, const Element& element, double distance_m) {
  const double curvature = element.curvature_start_per_m;
  const double rate = element.length_m > 0 ? rate_of(element) : 0.0;
  const Eigen::Vector2d moved = rate == 0.0 ? arc_displacement(start.heading_rad, curvature, distance_m)
                                            : clothoid_displacement(start.heading_rad, curvature, rate, distance_m);
  return {start.easting_m + moved.x(), start.northing_m + moved.y(),
          start.heading_rad - (curvature + 0.5 * rate * distance_m) * distance_m};
}

Alignment::Alignment(std::vector<Element> elements, std::vector<PlanPose> starts, std::vector<GradePoint> profile,
                     std::vector<CantPoint> cant)
    : elements_(std::move(elements)), starts_(std::move(starts)), profile_(std::move(profile)), cant_(std::move(cant)) {
  assert(elements_.size() == starts_.size());
  offsets_.reserve(elements_.size());
  for (const Element& element : elements_) {
    offsets_.push_back(length_m_);
    length_m_ += element.length_m;
  }
}

Alignment Alignment::chained(const PlanPose& start, std::vector<Element> elements, std::vector<GradePoint> profile,
                             std::vector<CantPoint> cant) {
  std::vector<PlanPose> starts;
  starts.reserve(elements.size());
  PlanPose pose = start;
  for (const Element& element : elements) {
    starts.push_back(pose);
    pose = advance(pose, element, element.length_m);
  }
  return {std::move(elements), std::move(starts), std::move(profile), std::move(cant)};
}

size_t Alignment::element_index(double offset_m) const {
  const auto after = std::upper_bound(offsets_.begin(), offsets_.end(), offset_m);
  return static_cast<size_t>(std::max<ptrdiff_t>(after - offsets_.begin() - 1, 0));
}

TrackPoint Alignment::at(double offset_m) const {
  TrackPoint out;
  if (elements_.empty()) return out;
  const size_t index = element_index(offset_m);
  const Element& element = elements_[index];
  const double into = offset_m - offsets_[index];
  out.pose = advance(starts_[index], element, into);
  out.pose.heading_rad = core::wrap_pi(out.pose.heading_rad);
  out.curvature_rate_per_m2 = rate_of(element);
  out.curvature_per_m = element.curvature_start_per_m + out.curvature_rate_per_m2 * into;
  apply_profile(profile_, offset_m, out);
  apply_cant(cant_, offset_m, out);
  return out;
}

bool Alignment::grade_known_at(double offset_m) const {
  if (profile_.size() < 2) return !profile_.empty();
  return !profile_[span_index(profile_, offset_m)].is_guess;
}

double Alignment::curvature_at(double offset_m) const {
  if (elements_.empty()) return 0.0;
  const size_t index = element_index(offset_m);
  return elements_[index].curvature_start_per_m + rate_of(elements_[index]) * (offset_m - offsets_[index]);
}

Alignment::Nearest Alignment::nearest(double easting_m, double northing_m) const {
  Nearest best;
  const Eigen::Vector2d target(easting_m, northing_m);
  double best_distance = std::numeric_limits<double>::infinity();
  std::vector<double> to_start(elements_.size());
  for (size_t i = 0; i < elements_.size(); ++i) {
    to_start[i] = (target - Eigen::Vector2d(starts_[i].easting_m, starts_[i].northing_m)).norm();
    if (to_start[i] < best_distance) {
      best_distance = to_start[i];
      best = {offsets_[i], to_start[i]};
    }
  }
  // An element cannot come nearer than the distance to its start less its length.
  best_distance = std::nextafter(best_distance, std::numeric_limits<double>::infinity());
  for (size_t i = 0; i < elements_.size(); ++i) {
    if (to_start[i] - elements_[i].length_m > best_distance) continue;
    const double into = ElementSearch(starts_[i], elements_[i], target).best();
    const PlanPose pose = advance(starts_[i], elements_[i], into);
    const Eigen::Vector2d away = target - Eigen::Vector2d(pose.easting_m, pose.northing_m);
    if (away.norm() > best_distance) continue;
    best_distance = away.norm();
    const double left = away.y() * std::sin(pose.heading_rad) - away.x() * std::cos(pose.heading_rad);
    best = {offsets_[i] + into, std::copysign(best_distance, left)};
  }
  return best;
}

}  // namespace railfix::track
