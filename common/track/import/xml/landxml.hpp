// LandXML 1.2 alignments: plan (Line, Curve, Spiral), profile (PVI, ParaCurve, CircCurve) and cant.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "core/result.hpp"
#include "track/import/tracks.hpp"

namespace railfix::track {

struct LandXml {
  std::vector<ImportedTrack> tracks;
  std::string crs;  // told by the file or known by its coordinates (Swiss LV95), else empty
  FitFigures figures;
  std::vector<std::string> problems;
};

/// Every element starts where the file says and ends where the file says: its curvature is the file's radius, its
/// length follows from the chord (it is given to the micrometre, as are the points), its heading from chord and
/// deflection. The file's directions are not used: programs disagree about what they are measured from.
core::Result<LandXml> read_landxml(const std::filesystem::path& file);

/// The heading and length with which an element of these curvatures leads from one point to the other.
struct ClosedElement {
  Element element;
  PlanPose start;
};
ClosedElement close_element(const Eigen::Vector2d& from, const Eigen::Vector2d& to, double curvature_start_per_m,
                            double curvature_end_per_m, double length_m);

}  // namespace railfix::track
