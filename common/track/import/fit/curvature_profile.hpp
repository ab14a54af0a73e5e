// Piecewise linear curvature along a track: its estimate from points, and its simplification.
#pragma once

#include <Eigen/Core>
#include <optional>
#include <vector>

#include "track/alignment.hpp"

namespace railfix::track {

/// A track that begins at a pose; curvature is linear between the knots, the first at 0. The last knot is its end.
struct CurvatureProfile {
  PlanPose start;
  std::vector<double> at_m;
  std::vector<double> curvature;

  [[nodiscard]] Alignment alignment() const;
  /// No radius below 10 m.
  [[nodiscard]] bool is_plausible() const;
};

/// What the track is to meet: points (the first and last exactly) and headings at the ends where they are known.
struct CurvatureTarget {
  std::vector<Eigen::Vector2d> points;
  double sigma_m = 0;
  std::optional<double> heading_at_start;
  std::optional<double> heading_at_end;
};

constexpr double kExactM = 1e-3;
constexpr double kExactRad = 1e-4;

/// Knots at the points, then Gauss-Newton. Fills the covariance of (heading at the start, curvatures).
CurvatureProfile dense_profile(const CurvatureTarget& target, Eigen::MatrixXd& covariance);

/// A simplified profile; knots with the same value number share their curvature, number 0 is zero curvature.
struct SparseProfile {
  PlanPose start;
  std::vector<double> at_m;
  std::vector<size_t> value;
  std::vector<double> values;

  [[nodiscard]] CurvatureProfile dense() const;
};

SparseProfile simplified(const CurvatureProfile& profile, Eigen::MatrixXd covariance);

/// Stations of the points along the track, growing; the last beyond its end where the track is too short.
std::vector<double> stations_of(const Alignment& track, const std::vector<Eigen::Vector2d>& points);

/// Signed distances of points from the track at their stations, left positive.
Eigen::VectorXd distances_of(const Alignment& track, const std::vector<Eigen::Vector2d>& points,
                             const std::vector<double>& stations);

}  // namespace railfix::track
