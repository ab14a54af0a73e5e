#include "track/import/xml/railml2_coordinates.hpp"
#include "track/import/told.hpp"
#include "track/import/xml/railml_readers.hpp"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <set>

namespace railfix::track {
namespace {

constexpr double kSamePlaceM = 0.05;
constexpr double kLengthShare = 0.02;   // points far apart cut curves short
constexpr double kUnevenSpacing = 3.0;  // of neighbouring gaps; beyond it a cubic swings out

/// Cubic through the two points around an offset and one more on either side, where there is one that suits the gap
/// between the two: nearer ones (balises of a group) would stretch their rounding over it, farther ones bend it.
Eigen::Vector2d interpolated(const std::vector<Railml2Coordinates::Point>& points, double offset_m) {
  const auto behind = std::lower_bound(points.begin() + 1, points.end() - 1, offset_m,
                                       [](const auto& point, double offset) { return point.offset_m < offset; });
  const auto before = behind - 1;
  const double gap_m = behind->offset_m - before->offset_m;
  std::vector<Railml2Coordinates::Point> through{*before, *behind};
  const auto add_if_suits = [&](auto from, auto to, double end_m) {
    const auto away_m = [&](const auto& point) { return std::abs(point.offset_m - end_m); };
    const auto found =
        std::find_if(from, to, [&](const auto& point) { return kUnevenSpacing * away_m(point) >= gap_m; });
    if (found != to && away_m(*found) <= kUnevenSpacing * gap_m) through.push_back(*found);
  };
  add_if_suits(std::make_reverse_iterator(before), points.rend(), before->offset_m);
  add_if_suits(behind + 1, points.end(), behind->offset_m);
  Eigen::Vector2d at{0, 0};
  for (const auto& point : through) {
    double weight = 1;
    for (const auto& other : through) {
      if (&other != &point) weight *= (offset_m - other.offset_m) / (point.offset_m - other.offset_m);
    }
    at += weight * point.at;
  }
  return at;
}

}  // namespace

Railml2Coordinates::Railml2Coordinates(const XmlSource& source) : source_(source), plane_(source) {
  for (const pugi::xml_node& code : descendants(source.root(), "epsgCode")) {
    const std::string number = epsg_number(code.attribute("default").value());
    if (default_code_.empty()) default_code_ = number;
  }
  if (default_code_.empty()) default_code_ = "4326";
}

Eigen::Vector2d Railml2Coordinates::in_plane(const pugi::xml_node& coordinate) {
  const std::string code = epsg_number(coordinate.attribute("epsgCode").value());
  const std::vector<double> values = numbers_of(coordinate.attribute("coord").value());
  if (values.size() < 2) throw source_.wrong(coordinate, "<geoCoord> needs two numbers or three in \"coord\"");
  return plane_.at(coordinate, "EPSG:" + (code.empty() ? default_code_ : code), values[0], values[1]);
}

std::vector<Railml2Coordinates::Point> Railml2Coordinates::points_of(const pugi::xml_node& track, double origin_m) {
  // Signals, platforms and the like stand beside the axis.
  static const std::set<std::string> kOnAxis{"trackBegin",     "trackEnd",      "switch", "crossing",    "geoMapping",
                                             "gradientChange", "mileageChange", "balise", "radiusChange"};
  std::vector<Point> points;
  for (const pugi::xml_node& coordinate : descendants(track, "geoCoord")) {
    const pugi::xml_node of = coordinate.parent();
    const auto pos = source_.number(of, "pos");
    if (!pos || !kOnAxis.contains(of.name())) continue;
    points.push_back({*pos - origin_m, in_plane(coordinate)});
  }
  std::stable_sort(points.begin(), points.end(),
                   [](const Point& a, const Point& b) { return a.offset_m < b.offset_m; });
  const auto same = [](const Point& a, const Point& b) { return b.offset_m - a.offset_m < kSamePlaceM; };
  points.erase(std::unique(points.begin(), points.end(), same), points.end());
  return points;
}

std::vector<Eigen::Vector2d> shape_between(const std::vector<Railml2Coordinates::Point>& points, double from_m,
                                           double to_m, std::string& why) {
  if (points.size() < 2 || points.front().offset_m > from_m + kNearEndM || points.back().offset_m < to_m - kNearEndM) {
    if (!points.empty()) why = kNotFromEndToEnd;
    return {};
  }
  std::vector<Eigen::Vector2d> shape{interpolated(points, from_m)};
  for (const auto& point : points) {
    if (point.offset_m > from_m + kNearEndM && point.offset_m < to_m - kNearEndM) shape.push_back(point.at);
  }
  shape.push_back(interpolated(points, to_m));
  double length_m = 0;
  for (size_t i = 1; i < shape.size(); ++i) length_m += (shape[i] - shape[i - 1]).norm();
  if (std::abs(length_m - (to_m - from_m)) > kNearEndM + kLengthShare * (to_m - from_m)) {
    why = "is " + told_m(to_m - from_m) + " long, but " + told_m(length_m) + " by its coordinates";
    return {};
  }
  return shape;
}

}  // namespace railfix::track
