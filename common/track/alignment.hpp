// The track preprocessor: position, heading, curvature, cant and grade of one track at any arc length (paper
// 004, 3.2-3.3).
#pragma once

#include <Eigen/Core>
#include <vector>

namespace railfix::track {

/// Straight, arc or clothoid: curvature changes linearly from start to end over the length (left positive).
struct Element {
  double length_m = 0;
  double curvature_start_per_m = 0;
  double curvature_end_per_m = 0;
};

/// No place of it is farther from the straight line between its ends.
double bulge_m(const Element& element);

/// A place in map coordinates with the direction of growing arc length.
struct PlanPose {
  double easting_m = 0;
  double northing_m = 0;
  double heading_rad = 0;  // clockwise from grid north
};

/// The same place, looking back.
PlanPose turned_round(const PlanPose& pose);

/// End pose of an element after `distance_m` of it (may be beyond its length or negative), closed form or series,
/// correct to rounding for lengths of kilometres and radii down to 50 m.
PlanPose advance(const PlanPose& start, const Element& element, double distance_m);

struct GradePoint {
  double offset_m = 0;
  double elevation_m = 0;
  double curve_length_m = 0;  // parabola centred at the point, 0 = sharp
  bool is_guess = false;      // from here to the next point: the grade is for people, no source says it well
};

struct CantPoint {
  double offset_m = 0;
  double cant_m = 0;  // positive where the right rail is higher
};

/// Everything about the track at one place.
struct TrackPoint {
  PlanPose pose;
  double elevation_m = 0;
  double grade = 0;                     // rise per metre
  double vertical_curvature_per_m = 0;  // hollow positive
  double curvature_per_m = 0;
  double curvature_rate_per_m2 = 0;
  double cant_m = 0;
  double twist = 0;  // change of cant per metre
};

/// One edge's geometry. Built once, then read from any thread.
class Alignment {
 public:
  Alignment() = default;
  /// REQUIRES: as many starts as elements (surveyed start of each, so that rounding does not add up), lengths > 0,
  /// profile and cant sorted by offset (may be empty).
  Alignment(std::vector<Element> elements, std::vector<PlanPose> starts, std::vector<GradePoint> profile,
            std::vector<CantPoint> cant);
  /// Chains the elements from one start pose.
  static Alignment chained(const PlanPose& start, std::vector<Element> elements, std::vector<GradePoint> profile = {},
                           std::vector<CantPoint> cant = {});

  [[nodiscard]] double length_m() const { return length_m_; }
  /// Offsets outside [0, length] continue the first or last element.
  [[nodiscard]] TrackPoint at(double offset_m) const;
  /// Can a train believe the grade there? Not where it is a guess, or there are no heights.
  [[nodiscard]] bool grade_known_at(double offset_m) const;
  /// Curvature alone (fast, for matching).
  [[nodiscard]] double curvature_at(double offset_m) const;
  /// Offset and signed distance (left positive) of the nearest point of the track.
  struct Nearest {
    double offset_m = 0;
    double lateral_m = 0;
  };
  [[nodiscard]] Nearest nearest(double easting_m, double northing_m) const;

  [[nodiscard]] const std::vector<Element>& elements() const { return elements_; }
  [[nodiscard]] const std::vector<PlanPose>& starts() const { return starts_; }
  [[nodiscard]] const std::vector<double>& element_offsets() const { return offsets_; }
  [[nodiscard]] const std::vector<GradePoint>& profile() const { return profile_; }
  [[nodiscard]] const std::vector<CantPoint>& cant() const { return cant_; }

 private:
  [[nodiscard]] size_t element_index(double offset_m) const;
  std::vector<Element> elements_;
  std::vector<PlanPose> starts_;
  std::vector<double> offsets_;  // of each element's start
  std::vector<GradePoint> profile_;
  std::vector<CantPoint> cant_;
  double length_m_ = 0;
};

}  // namespace railfix::track
