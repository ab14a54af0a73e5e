#include "simulator/builtin_line.hpp"

#include <array>
#include <cmath>

namespace railfix::simulator {
namespace {

using track::Element;
using track::LandmarkKind;

constexpr double kHalfGauge = 0.7175;
constexpr double kLoopRadiusM = 300.0;  // of its turnouts
constexpr double kLoopSpacingM = 4.7;
constexpr double kMastSpacingM = 60.0;
constexpr uint32_t kNidC = 384;
constexpr double kSurveySigmaM = 0.05;

// Elements and cant of one edge, written down curve by curve.
class Drawing {
 public:
  Drawing& straight(double length_m) { return add({length_m, 0.0, 0.0}); }
  /// Clothoid in, arc, clothoid out; radius left positive, cant_m of the arc without sign.
  Drawing& curve(double radius_m, double transition_m, double arc_m, double cant_m) {
    const double curvature = 1.0 / radius_m;
    const double cant = std::copysign(cant_m, radius_m);
    cant_.push_back({length_m_, 0.0});
    add({transition_m, 0.0, curvature});
    cant_.push_back({length_m_, cant});
    add({arc_m, curvature, curvature});
    cant_.push_back({length_m_, cant});
    add({transition_m, curvature, 0.0});
    cant_.push_back({length_m_, 0.0});
    return *this;
  }
  Drawing& arc(double radius_m, double arc_m) { return add({arc_m, 1.0 / radius_m, 1.0 / radius_m}); }
  [[nodiscard]] track::Alignment from(const track::PlanPose& start, std::vector<track::GradePoint> profile) const {
    return track::Alignment::chained(start, elements_, std::move(profile), cant_);
  }

 private:
  Drawing& add(const Element& element) {
    elements_.push_back(element);
    length_m_ += element.length_m;
    return *this;
  }
  std::vector<Element> elements_;
  std::vector<track::CantPoint> cant_;
  double length_m_ = 0;
};

class Builder {
 public:
  track::Map map;

  uint32_t node(track::NodeKind kind, const std::string& name, const track::PlanPose& pose) {
    const auto id = static_cast<uint32_t>(map.nodes.size() + 1);
    map.nodes.push_back({id, kind, name, pose.easting_m, pose.northing_m});
    return id;
  }
  uint32_t edge(const std::string& name, uint32_t from, uint32_t to, track::Alignment alignment) {
    const auto id = static_cast<uint32_t>(map.edges.size() + 1);
    map.edges.push_back({id, name, from, to, "1", std::move(alignment)});
    return id;
  }
  uint32_t landmark(LandmarkKind kind, uint32_t edge, double offset_m, double lateral_m, const std::string& name) {
    const auto id = static_cast<uint32_t>(map.landmarks.size() + 1);
    map.landmarks.push_back({id, kind, edge, offset_m, lateral_m, kSurveySigmaM, name});
    return id;
  }
  void balise_group(uint32_t edge, double offset_m) {
    const auto number = static_cast<uint32_t>(map.balise_groups.size() + 1);
    const std::string name = "BG" + std::to_string(100 + number);
    track::BaliseGroup group;
    group.nid_c = kNidC;
    group.nid_bg = 100 + number;
    group.edge = edge;
    group.offset_m = offset_m;
    group.balises = {landmark(LandmarkKind::balise, edge, offset_m, 0.0, name + ".1"),
                     landmark(LandmarkKind::balise, edge, offset_m + 3.0, 0.0, name + ".2")};
    map.balise_groups.push_back(std::move(group));
  }
};

// Where the main track's left rail and the branch's right rail cross: the mathematical point of the frog.
double frog_offset(const track::Alignment& main, const track::Alignment& branch, double from_m, double to_m) {
  const auto gap = [&](double s) {
    const auto pose = main.at(s).pose;
    const double e = pose.easting_m - kHalfGauge * std::cos(pose.heading_rad);
    const double n = pose.northing_m + kHalfGauge * std::sin(pose.heading_rad);
    return branch.nearest(e, n).lateral_m + kHalfGauge;
  };
  const bool begins_above = gap(from_m) > 0.0;
  for (int i = 0; i < 60; ++i) {
    const double middle = 0.5 * (from_m + to_m);
    ((gap(middle) > 0.0) == begins_above ? from_m : to_m) = middle;
  }
  return 0.5 * (from_m + to_m);
}

track::Alignment loop(const track::PlanPose& start, double main_length_m) {
  const double angle = std::atan(1.0 / 9.0);
  const double between = (kLoopSpacingM - 2.0 * kLoopRadiusM * (1.0 - std::cos(angle))) / std::sin(angle);
  const double arc = kLoopRadiusM * angle;
  const double ladder = 2.0 * kLoopRadiusM * std::sin(angle) + between * std::cos(angle);
  Drawing drawing;
  drawing.arc(kLoopRadiusM, arc).straight(between).arc(-kLoopRadiusM, arc);
  drawing.straight(main_length_m - 2.0 * ladder);
  drawing.arc(-kLoopRadiusM, arc).straight(between).arc(kLoopRadiusM, arc);
  return drawing.from(start, {});
}

void furnish(Builder& builder) {
  const auto& edges = builder.map.edges;
  const auto& station = edges[1].alignment;
  const auto& siding = edges[3].alignment;
  builder.landmark(LandmarkKind::frog, 2, frog_offset(station, siding, 10.0, 60.0), kHalfGauge, "switch 1");
  builder.landmark(LandmarkKind::frog, 2,
                   frog_offset(station, siding, station.length_m() - 60.0, station.length_m() - 10.0), kHalfGauge,
                   "switch 2");
  builder.landmark(LandmarkKind::platform, 2, 120.0, -1.67, "platform 1 west end");
  builder.landmark(LandmarkKind::platform, 2, 340.0, -1.67, "platform 1 east end");
  builder.landmark(LandmarkKind::bridge, 1, 860.0, 0.0, "road bridge");
  builder.landmark(LandmarkKind::portal_in, 3, 760.0, 0.0, "tunnel west portal");
  builder.landmark(LandmarkKind::portal_out, 3, 910.0, 0.0, "tunnel east portal");
  for (const double offset : {200.0, 600.0, 1000.0, 1320.0}) builder.balise_group(1, offset);
  builder.balise_group(2, 230.0);
  for (const double offset : {60.0, 460.0, 740.0, 1100.0, 1500.0, 1900.0}) builder.balise_group(3, offset);
  for (uint32_t id = 1; id <= 3; ++id) {
    int number = 0;
    for (double s = 30.0; s < edges[id - 1].alignment.length_m(); s += kMastSpacingM, ++number) {
      if (id == 3 && s > 750.0 && s < 920.0) continue;
      const double lateral = id == 2 ? -6.6 : (number % 2 == 0 ? -3.3 : 3.3);
      builder.landmark(LandmarkKind::mast, id, s, lateral, "mast " + std::to_string(id) + "-" + std::to_string(number));
    }
  }
}

}  // namespace

track::Map builtin_line() {
  Builder builder;
  builder.map.name = "built-in line";
  builder.map.source = "made by railfix simulate";
  builder.map.crs = "EPSG:2056";
  const track::PlanPose start{2683000.0, 1248000.0, 1.1};
  const auto west = Drawing()
                        .straight(350)
                        .curve(600, 80, 200, 0.08)
                        .straight(150)
                        .curve(-1000, 60, 250, 0.05)
                        .straight(150)
                        .from(start, {{0, 440.0, 0}, {300, 440.0, 60}, {1100, 444.0, 60}, {1380, 444.0, 0}});
  const auto west_end = west.at(west.length_m()).pose;
  const auto station = Drawing().straight(460).from(west_end, {{0, 444.0, 0}, {460, 444.0, 0}});
  const auto station_end = station.at(station.length_m()).pose;
  const auto east = Drawing()
                        .straight(120)
                        .curve(-400, 100, 220, 0.12)
                        .straight(100)
                        .curve(800, 60, 300, 0.07)
                        .straight(300)
                        .curve(-1500, 50, 200, 0.03)
                        .straight(500)
                        .from(station_end, {{0, 444.0, 0}, {300, 444.0, 80}, {1300, 434.0, 80}, {2160, 434.0, 0}});
  auto siding = loop(west_end, station.length_m());
  siding = track::Alignment(siding.elements(), siding.starts(), {{0, 444.0, 0}, {siding.length_m(), 444.0, 0}}, {});

  const auto begin = builder.node(track::NodeKind::end, "west end", start);
  const auto first = builder.node(track::NodeKind::railway_switch, "switch 1", west_end);
  const auto second = builder.node(track::NodeKind::railway_switch, "switch 2", station_end);
  const auto end = builder.node(track::NodeKind::end, "east end", east.at(east.length_m()).pose);
  builder.edge("main_west", begin, first, west);
  builder.edge("main_station", first, second, station);
  builder.edge("main_east", second, end, east);
  builder.edge("loop", first, second, std::move(siding));
  builder.map.connections = {{first, 1, 2, false}, {first, 1, 4, true}, {second, 2, 3, false}, {second, 4, 3, true}};
  furnish(builder);
  return std::move(builder.map);
}

}  // namespace railfix::simulator
