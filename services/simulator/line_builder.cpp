#include "simulator/line_builder.hpp"

#include <cmath>
#include <stdexcept>

#include "track/frog.hpp"

namespace railfix::simulator {
namespace {

using track::LandmarkKind;

constexpr double kLoopRadiusM = 300.0;  // of its turnouts
constexpr double kFrogRatio = 1.0 / 9.0;
constexpr uint32_t kNidC = 384;
constexpr double kSurveySigmaM = 0.05;
constexpr double kFrogSurveySigmaM = 0.02;  // two edges that cross, and no wear since
constexpr double kBesideStepM = 10.0;

track::Alignment loop_beside(const track::Alignment& main, double side) {
  const double angle = std::atan(kFrogRatio);
  const double between = (kLoopSpacingM - 2.0 * kLoopRadiusM * (1.0 - std::cos(angle))) / std::sin(angle);
  const double arc = kLoopRadiusM * angle;
  const double ladder = 2.0 * kLoopRadiusM * std::sin(angle) + between * std::cos(angle);
  Drawing drawing;
  drawing.arc(side * kLoopRadiusM, arc).straight(between).arc(-side * kLoopRadiusM, arc);
  drawing.straight(main.length_m() - 2.0 * ladder);
  drawing.arc(-side * kLoopRadiusM, arc).straight(between).arc(side * kLoopRadiusM, arc);
  const double level_m = main.at(0.0).elevation_m;
  return drawing.from(main.at(0.0).pose, {{0, level_m, 0}, {drawing.length_m(), level_m, 0}});
}

}  // namespace

Drawing& Drawing::curve(double radius_m, double transition_m, double arc_m, double cant_m) {
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

uint32_t LineBuilder::node(track::NodeKind kind, const std::string& name, const track::PlanPose& pose) {
  const auto id = static_cast<uint32_t>(map.nodes.size() + 1);
  map.nodes.push_back({id, kind, name, pose.easting_m, pose.northing_m});
  return id;
}

uint32_t LineBuilder::edge(const std::string& name, uint32_t from, uint32_t to, track::Alignment alignment) {
  const auto id = static_cast<uint32_t>(map.edges.size() + 1);
  map.edges.push_back({id, name, from, to, "1", std::move(alignment)});
  return id;
}

uint32_t LineBuilder::landmark(LandmarkKind kind, uint32_t edge, double offset_m, double lateral_m,
                               const std::string& name) {
  const auto id = static_cast<uint32_t>(map.landmarks.size() + 1);
  const double sigma_m = kind == LandmarkKind::frog ? kFrogSurveySigmaM : kSurveySigmaM;
  map.landmarks.push_back({id, kind, edge, offset_m, lateral_m, sigma_m, name});
  return id;
}

void LineBuilder::balise_group(uint32_t edge, double offset_m) {
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

uint32_t LineBuilder::second_track(const std::string& name, uint32_t beside, double from_m, double to_m,
                                   double lateral_m) {
  const auto& main = map.edges[beside - 1].alignment;
  std::vector<track::Element> elements;
  std::vector<track::PlanPose> starts;
  std::vector<track::GradePoint> profile;
  std::vector<track::CantPoint> cant;
  double length_m = 0.0;
  const auto place = [&](double s) {
    auto pose = main.at(s).pose;
    pose.easting_m -= lateral_m * std::cos(pose.heading_rad);
    pose.northing_m += lateral_m * std::sin(pose.heading_rad);
    return pose;
  };
  // A parallel of a clothoid is none; short pieces with surveyed starts follow it to a fraction of a millimetre.
  const auto pieces = static_cast<int>(std::round((to_m - from_m) / kBesideStepM));
  for (int i = 0; i <= pieces; ++i) {
    const double s = from_m + (to_m - from_m) * i / pieces;
    profile.push_back({length_m, main.at(s).elevation_m, 0.0});
    cant.push_back({length_m, main.at(s).cant_m});
    if (i == pieces) break;
    const double next = from_m + (to_m - from_m) * (i + 1) / pieces;
    const double a = main.curvature_at(s + 1e-6);
    const double b = main.curvature_at(next - 1e-6);
    elements.push_back(
        {(next - s) * (1.0 - 0.5 * (a + b) * lateral_m), a / (1.0 - a * lateral_m), b / (1.0 - b * lateral_m)});
    starts.push_back(place(s));
    length_m += elements.back().length_m;
  }
  const auto begin = node(track::NodeKind::end, name + " begin", place(from_m));
  const auto end = node(track::NodeKind::end, name + " end", place(to_m));
  return edge(name, begin, end, {std::move(elements), std::move(starts), std::move(profile), std::move(cant)});
}

uint32_t LineBuilder::loop(const std::string& name, uint32_t beside, double side) {
  const auto& of = map.edges[beside - 1];
  const auto first = of.from_node;
  const auto second = of.to_node;
  const auto id = edge(name, first, second, loop_beside(of.alignment, side));
  const auto& main = map.edges[beside - 1].alignment;
  const auto& branch = map.edges[id - 1].alignment;
  for (const bool near : {true, false}) {
    const auto at_node = near ? first : second;
    const auto frog = track::frog_place({&main, near}, {&branch, near});
    if (!frog) throw std::logic_error("the rails of a loop's switch do not cross");
    const std::string& switch_name = map.nodes[at_node - 1].name;
    landmark(LandmarkKind::frog, beside, frog->on_straight_m, side * 0.5 * track::kGaugeM, switch_name);
    landmark(LandmarkKind::frog, id, frog->on_branch_m, -side * 0.5 * track::kGaugeM, switch_name + " from the loop");
  }
  return id;
}

}  // namespace railfix::simulator
