#include "track/import/fit/biarc.hpp"

#include <algorithm>
#include <cmath>

#include "core/units.hpp"
#include "track/import/fit/plane.hpp"

namespace railfix::track {
namespace {

constexpr double kClosestPointsM = 2.0;
constexpr double kSharpestBiarcPerM = 1.0 / 15.0;

struct Arc {
  Element element;
  PlanPose start;
};

/// The arc that leaves `from` in the given direction and ends at `to`.
Arc arc_to(const Eigen::Vector2d& from, const Eigen::Vector2d& tangent, const Eigen::Vector2d& to) {
  const Eigen::Vector2d chord = to - from;
  const double half_turn = std::atan2(cross(tangent, chord), tangent.dot(chord));
  const double curvature = 2.0 * std::sin(half_turn) / chord.norm();
  const double length = std::abs(half_turn) < 1e-9 ? chord.norm() : chord.norm() * half_turn / std::sin(half_turn);
  return {{length, curvature, curvature}, {from.x(), from.y(), heading_of(tangent)}};
}

/// Where two arcs with equal tangent lengths meet (the usual biarc).
Eigen::Vector2d meeting_point(const Eigen::Vector2d& from, const Eigen::Vector2d& t0, const Eigen::Vector2d& to,
                              const Eigen::Vector2d& t1) {
  const Eigen::Vector2d chord = to - from;
  const double a = 2.0 * (1.0 - t0.dot(t1));
  const double b = 2.0 * chord.dot(t0 + t1);
  const double c = -chord.squaredNorm();
  const double root = std::sqrt(std::max(b * b - 4.0 * a * c, 0.0));
  const double tangent_length = -2.0 * c / (b + root);  // stable where the tangents are parallel (a = 0)
  return 0.5 * (from + to + tangent_length * (t0 - t1));
}

/// Distance of a point from the straight line between two others.
double beside(const Eigen::Vector2d& point, const Eigen::Vector2d& a, const Eigen::Vector2d& b) {
  const double length = (b - a).norm();
  return length > 0 ? std::abs(cross(b - a, point - a)) / length : (point - a).norm();
}

class Fitter {
 public:
  Fitter(std::vector<Eigen::Vector2d> points, std::optional<double> heading_at_start,
         std::optional<double> heading_at_end)
      : points_(std::move(points)), tangents_(points_.size()) {
    const size_t last = points_.size() - 1;
    for (size_t i = 1; i < last; ++i) {
      const Eigen::Vector2d before = points_[i] - points_[i - 1];
      const Eigen::Vector2d after = points_[i + 1] - points_[i];
      const double turn = core::wrap_pi(heading_of(after) - heading_of(before));
      tangents_[i] = heading_of(before) + turn * before.norm() / (before.norm() + after.norm());
    }
    // The free ends mirror the next tangent at their chord: one arc.
    const double first_chord = heading_of(points_[1] - points_[0]);
    const double last_chord = heading_of(points_[last] - points_[last - 1]);
    if (last == 1) {
      tangents_[0] = heading_at_start.value_or(heading_at_end ? 2.0 * first_chord - *heading_at_end : first_chord);
      tangents_[1] = heading_at_end.value_or(2.0 * first_chord - tangents_[0]);
    } else {
      tangents_[0] = heading_at_start.value_or(2.0 * first_chord - tangents_[1]);
      tangents_[last] = heading_at_end.value_or(2.0 * last_chord - tangents_[last - 1]);
    }
  }

  void fit(PolylineFit& out) {
    for (size_t i = 0; i + 1 < points_.size(); ++i) add_span(i, out);
    for (size_t i = 1; i < elements_.size(); ++i) {
      const PlanPose before = advance(starts_[i - 1], elements_[i - 1], elements_[i - 1].length_m);
      out.figures.max_heading_step_rad = std::max(out.figures.max_heading_step_rad,
                                                  std::abs(core::wrap_pi(before.heading_rad - starts_[i].heading_rad)));
      out.figures.max_end_error_m =
          std::max(out.figures.max_end_error_m,
                   std::hypot(before.easting_m - starts_[i].easting_m, before.northing_m - starts_[i].northing_m));
    }
    out.figures.elements = elements_.size();
    out.alignment = Alignment(std::move(elements_), std::move(starts_), {}, {});
  }

 private:
  void add_span(size_t i, PolylineFit& out) {
    const Eigen::Vector2d& from = points_[i];
    const Eigen::Vector2d& to = points_[i + 1];
    const double chord = heading_of(to - from);
    const double turn_in = std::abs(core::wrap_pi(chord - tangents_[i]));
    const double turn_out = std::abs(core::wrap_pi(tangents_[i + 1] - chord));
    if (std::max(turn_in, turn_out) < core::kPi / 2.5) {
      const Eigen::Vector2d t0 = direction_of(tangents_[i]);
      const Eigen::Vector2d middle = meeting_point(from, t0, to, direction_of(tangents_[i + 1]));
      const Arc first = arc_to(from, t0, middle);
      const PlanPose half = advance(first.start, first.element, first.element.length_m);
      const Arc second = arc_to(middle, direction_of(half.heading_rad), to);
      const double sharpest =
          std::max(std::abs(first.element.curvature_start_per_m), std::abs(second.element.curvature_start_per_m));
      if (sharpest < kSharpestBiarcPerM && first.element.length_m > 1e-3 && second.element.length_m > 1e-3) {
        take(first, from, to, out);
        take(second, from, to, out);
        return;
      }
    }
    ++out.straightened;
    take(arc_to(from, direction_of(chord), to), from, to, out);
  }

  void take(const Arc& arc, const Eigen::Vector2d& from, const Eigen::Vector2d& to, PolylineFit& out) {
    for (const double part : {0.25, 0.5, 0.75, 1.0}) {
      const PlanPose pose = advance(arc.start, arc.element, part * arc.element.length_m);
      out.figures.max_chord_deviation_m =
          std::max(out.figures.max_chord_deviation_m, beside({pose.easting_m, pose.northing_m}, from, to));
    }
    elements_.push_back(arc.element);
    starts_.push_back(arc.start);
  }

  std::vector<Eigen::Vector2d> points_;
  std::vector<double> tangents_;
  std::vector<Element> elements_;
  std::vector<PlanPose> starts_;
};

}  // namespace

std::vector<Eigen::Vector2d> thinned(const std::vector<Eigen::Vector2d>& points) {
  std::vector<Eigen::Vector2d> kept{points.front()};
  for (size_t i = 1; i + 1 < points.size(); ++i) {
    if ((points[i] - kept.back()).norm() >= kClosestPointsM && (points[i] - points.back()).norm() >= kClosestPointsM) {
      kept.push_back(points[i]);
    }
  }
  kept.push_back(points.back());
  return kept;
}

PolylineFit fit_polyline(const std::vector<Eigen::Vector2d>& points, std::optional<double> heading_at_start,
                         std::optional<double> heading_at_end) {
  PolylineFit out;
  Fitter(points, heading_at_start, heading_at_end).fit(out);
  return out;
}

}  // namespace railfix::track
