// Straights, clothoids and arcs through noisy points: curvature is piecewise linear, with as few pieces as the points
// justify.
//
// 1. Curvature at a knot per point (15 m or more apart, half of that at the end; more where points are far apart), by
//    least squares on the distances of the points from the track, with a weak prior on how fast curvature may change.
// 2. Knots that a Wald test does not need go one after the other; neighbours that are not different become one arc,
//    curvatures that are not different from zero a straight (general least squares with linear restrictions).
// 3. Curvatures and the places where pieces meet, by least squares once more (Levenberg, Marquardt).
#pragma once

#include <Eigen/Core>
#include <optional>
#include <string>
#include <vector>

#include "track/alignment.hpp"

namespace railfix::track {

struct ClothoidFitOptions {
  std::optional<double> heading_at_start;  // along the track
  std::optional<double> heading_at_end;
  double sigma_m = 0;        // of a point across the track; 0 = from the points themselves, 2 cm at least
  double usual_sigma_m = 0;  // where that is 0: scatter of drawings of this kind, which counts as much as four points'
                             // own; 0 = not known, then tracks of fewer than six points are not fitted
};

struct ClothoidFit {
  Alignment alignment;
  double sigma_m = 0;  // of a point, as used
  double rms_m = 0;    // of the points from the track
  double max_m = 0;
  std::vector<double> element_max_m;  // the same, of the points beside each element
  size_t left_out = 0;                // points that lie apart from the track
  double left_out_max_m = 0;          // how far the farthest of them
  double arcs_m = 0;                  // length of stretches that are left as arcs through their points
};

/// Begins and ends at the first and last point. Nothing where the points are too few (six, three with a usual sigma) or
/// no track fits them within six sigma or half a metre. REQUIRES: neighbours at least 1 cm apart.
std::optional<ClothoidFit> fit_clothoids(const std::vector<Eigen::Vector2d>& points, const ClothoidFitOptions& options);

/// The same for drawings with mistakes: without the few points (one in ten) that lie apart from the track, else in
/// parts with equal headings where they meet, of which those that no track fits stay arcs through their points.
std::optional<ClothoidFit> fit_drawing(const std::vector<Eigen::Vector2d>& points, const ClothoidFitOptions& options);

/// The fit of the whole, good or not, and how far every point lies off it. Nothing where it failed.
std::optional<ClothoidFit> fit_somehow(const std::vector<Eigen::Vector2d>& points, const ClothoidFitOptions& options,
                                       std::vector<double>& off_m);
/// How far points of a track may lie off it.
double fit_limit_m(double sigma_m);

/// One element of a fitted track and how far the worst point beside it lies off.
struct FittedElement {
  std::string track;
  double offset_m = 0;
  Element element;
  double max_m = 0;
};

/// How well polylines became straights, clothoids and arcs.
struct FitReport {
  std::vector<FittedElement> elements;
  size_t tracks = 0;
  size_t left_as_arcs = 0;  // tracks too crooked, two arcs between every pair of points
  size_t two_points = 0;    // tracks with nothing to fit: two arcs
  size_t points = 0;
  double squared_sum_m2 = 0;
  double max_m = 0;
  size_t left_out = 0;  // points
  double arcs_m = 0;    // of fitted tracks

  void add(const std::string& track, const ClothoidFit& fit, size_t points_of_track);
  [[nodiscard]] double rms_m() const;
};

/// How far each point lies off the cubic through its four neighbours, in units of what equal scatter of all five gives;
/// 0 for the first and last two.
std::vector<double> apart_from_neighbours(const std::vector<Eigen::Vector2d>& points);

/// Scatter of the points across their line, from how far each lies off the cubic through its four neighbours.
double scatter_of(const std::vector<Eigen::Vector2d>& points);

}  // namespace railfix::track
