// A smooth track through surveyed points: two arcs between every pair of them (biarcs), equal headings where they meet.
#pragma once

#include <Eigen/Core>
#include <optional>
#include <vector>

#include "track/import/tracks.hpp"

namespace railfix::track {

struct PolylineFit {
  Alignment alignment;
  FitFigures figures;       // max_chord_deviation_m: of the track from the polyline
  size_t straightened = 0;  // stretches too crooked for a track, left as straight lines with kinks at their ends
};

/// The track runs exactly through the points. The tangent at a point is that of the circle through it and its
/// neighbours; the headings at both ends may be given (along the track). REQUIRES: two points or more, no neighbours
/// nearer than 1 cm.
PolylineFit fit_polyline(const std::vector<Eigen::Vector2d>& points, std::optional<double> heading_at_start,
                         std::optional<double> heading_at_end);

/// Points far enough apart for a heading: first and last, and those at least 2 m from the one before and from the last.
std::vector<Eigen::Vector2d> thinned(const std::vector<Eigen::Vector2d>& points);

}  // namespace railfix::track
