// Tracks and how they are linked, as planning formats (railML, ERJU) give them: places count along each track, the
// plan may be surveyed, described by radii, or missing.
#pragma once

#include <cmath>
#include <optional>

#include "track/import/fit/clothoid_fit.hpp"
#include "track/import/network.hpp"

namespace railfix::track {

/// A stretch of constant or steadily changing curvature; straight in between.
struct NetBend {
  double from_m = 0;
  double to_m = 0;
  double curvature_start_per_m = 0;
  double curvature_end_per_m = 0;
};

/// The grade from here on.
struct NetSlope {
  double offset_m = 0;
  double grade = 0;
  double curve_length_m = 0;  // parabola centred at the place, 0 = sharp
  bool is_guess = false;      // the source says none; so is what lies before the first one
};

/// No projection leads farther, with the number of a zone before the easting. Points beyond are none: no fit of them
/// ends.
constexpr double kFarthestM = 1e8;
inline bool is_place(const Eigen::Vector2d& at) {
  return std::abs(at.x()) < kFarthestM && std::abs(at.y()) < kFarthestM;
}
constexpr const char* kNoPlace = "coordinates that no map has; they are metres, and below 100,000,000";

struct NetTrack {
  ImportedTrack track;                 // name, line, marks and groups; its alignment is made here
  double length_m = 0;                 // as the source counts
  std::vector<Eigen::Vector2d> shape;  // surveyed points in the plane of the map, from begin to end
  std::vector<Element> plan{};         // where the source says it beside the points: the whole track, without a gap
  std::vector<NetBend> bends;
  std::vector<NetSlope> slopes;
  std::vector<CantPoint> cant;
  [[nodiscard]] bool has_shape() const { return shape.size() >= 2; }  // else it is laid out as a drawing
};

struct NetEnd {
  size_t track = 0;
  bool at_end = false;
  auto operator<=>(const NetEnd&) const = default;
};

/// Two ends meet at one place; trains run from one to the other where `passable`.
struct NetLink {
  NetEnd a;
  NetEnd b;
  bool passable = true;
  bool crosses = false;  // the tracks only cross: laid out like a way, but none
  bool diverging = false;
  double side = 0;  // of the diverging way, seen from the blades: left 1, right -1
  std::string switch_name{};
};

struct RailNet {
  std::vector<NetTrack> tracks;
  std::vector<NetLink> links;
  std::string crs;  // of the shapes; empty where there are none
  FitFigures figures;
  FitReport fit;
  std::vector<std::string> problems;
};

/// Makes the plan and joins it up. A track without a shape follows its bends, or runs straight, from where the tracks
/// before it end: its lengths and links are right, its coordinates are not, and `problems` says so.
Draft draft_of(RailNet& net);

/// Cuts the track at an offset: the part from there on becomes the last track, of this name; ends of links are moved
/// along. Returns the new track's index.
size_t split(RailNet& net, size_t track, double offset_m, const std::string& name);

}  // namespace railfix::track
