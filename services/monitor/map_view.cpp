#include "monitor/map_view.hpp"

#include <algorithm>
#include <cmath>
#include <unordered_map>

namespace railfix::monitor {
namespace {

using nlohmann::json;

constexpr double kSagittaM = 0.1;  // that a drawn curve may be away from the true one
constexpr double kShortestStepM = 5;
constexpr double kCurveStepM = 20;
constexpr double kStraightStepM = 500;
constexpr double kStraightPerM = 1e-7;
constexpr double kProfileStepM = 5;
constexpr double kBendStepM = 2;

double rounded(double value, double unit) {
  return std::round(value / unit) * unit;
}

json number(double value, double parts) {
  return std::isfinite(value) ? json(std::round(value * parts) / parts) : json(nullptr);
}

json point_of(const track::Edge& edge, double offset_m) {
  const auto point = edge.alignment.at(offset_m);
  return {number(offset_m, 100), number(point.pose.easting_m, 100), number(point.pose.northing_m, 100),
          edge.alignment.grade_known_at(offset_m) ? number(point.elevation_m, 100) : json(nullptr),
          number(point.curvature_per_m, 1e7)};
}

json line_of(const track::Edge& edge) {
  const auto& alignment = edge.alignment;
  json line = json::array();
  for (size_t i = 0; i < alignment.elements().size(); ++i) {
    const auto& element = alignment.elements()[i];
    const double sharpest = std::max(std::abs(element.curvature_start_per_m), std::abs(element.curvature_end_per_m));
    const double wanted_m = sharpest < kStraightPerM
                                ? kStraightStepM
                                : std::clamp(std::sqrt(8 * kSagittaM / sharpest), kShortestStepM, kCurveStepM);
    const auto steps = static_cast<int>(std::ceil(element.length_m / wanted_m));
    for (int step = 0; step < steps; ++step) {
      line.push_back(point_of(edge, alignment.element_offsets()[i] + element.length_m * step / steps));
    }
  }
  line.push_back(point_of(edge, alignment.length_m()));
  return line;
}

struct Place {
  double easting_m = 0;
  double northing_m = 0;
};

Place beside(const track::Edge& edge, double offset_m, double left_m) {
  const auto pose = edge.alignment.at(offset_m).pose;
  return {pose.easting_m - left_m * std::cos(pose.heading_rad), pose.northing_m + left_m * std::sin(pose.heading_rad)};
}

json landmark_json(const track::Landmark& landmark, const track::Edge& edge) {
  const Place place = beside(edge, landmark.offset_m, landmark.lateral_m);
  return {{"id", landmark.id},
          {"kind", track::to_string(landmark.kind)},
          {"name", landmark.name},
          {"edge", landmark.edge},
          {"offset_m", number(landmark.offset_m, 100)},
          {"easting_m", number(place.easting_m, 100)},
          {"northing_m", number(place.northing_m, 100)},
          {"across_m", number(landmark.lateral_m, 100)}};
}

}  // namespace

MapView::MapView(const track::Map& map) : map_(map), ways_(map) {
  for (const auto& edge : map.edges) length_m_ += edge.alignment.length_m();
}

json MapView::message(const std::optional<track::EdgePosition>& around, double radius_m) const {
  std::optional<track::PlanPose> centre;
  if (around) {
    if (const auto* edge = map_.edge(around->edge)) centre = edge->alignment.at(around->offset_m).pose;
  }
  std::unordered_map<uint32_t, const track::Edge*> shown_at;  // node: the first edge there that is shown
  std::vector<bool> shown(map_.edges.size() + 1, false);
  json edges = json::array();
  for (const auto& edge : map_.edges) {
    if (centre) {
      const auto start = edge.alignment.at(0).pose;
      const double away_m = std::hypot(start.easting_m - centre->easting_m, start.northing_m - centre->northing_m);
      if (!(away_m - edge.alignment.length_m() <= radius_m)) continue;
    }
    shown[edge.id] = true;
    for (const uint32_t node : {edge.from_node, edge.to_node}) shown_at.try_emplace(node, &edge);
    edges.push_back({{"id", edge.id}, {"length_m", number(edge.alignment.length_m(), 100)}, {"line", line_of(edge)}});
  }
  json switches = json::array();
  for (const auto& node : map_.nodes) {
    if (node.kind != track::NodeKind::railway_switch) continue;
    const auto at = shown_at.find(node.id);
    if (at == shown_at.end()) continue;
    const track::Edge* edge = at->second;
    const double offset_m = edge->from_node == node.id ? 0 : edge->alignment.length_m();
    switches.push_back({{"id", node.id},
                        {"edge", edge->id},
                        {"offset_m", number(offset_m, 100)},
                        {"easting_m", number(node.easting_m, 100)},
                        {"northing_m", number(node.northing_m, 100)}});
  }
  json landmarks = json::array();
  for (const auto& landmark : map_.landmarks) {
    const auto* edge = map_.edge(landmark.edge);
    if (edge != nullptr && shown[edge->id]) landmarks.push_back(landmark_json(landmark, *edge));
  }
  return {{"edges", std::move(edges)}, {"switches", std::move(switches)}, {"landmarks", std::move(landmarks)}};
}

std::optional<track::Route> MapView::route(const track::EdgePosition& train, double behind_m, double ahead_m) const {
  if (map_.edge(train.edge) == nullptr) return std::nullopt;
  track::Route route(track::run_of(map_, train), train.offset_m, 0);
  track::follow_on(route, ways_, 0, ahead_m, behind_m);
  return route;
}

json MapView::curvature(const track::EdgePosition& train, double behind_m, double ahead_m) const {
  json profile = json::array();
  const auto way = route(train, behind_m, ahead_m);
  if (!way) return profile;
  // At whole steps of the line, so that the curve drawn does not tremble while the train moves.
  const double first_m = rounded(std::max(-behind_m, way->begin_m()), kProfileStepM);
  for (double x = first_m; x <= std::min(ahead_m, way->end_m()); x += kProfileStepM) {
    profile.push_back({number(x, 10), number(way->curvature_at(x), 1e7)});
  }
  return profile;
}

std::vector<LandmarkAhead> MapView::landmarks_ahead(const track::EdgePosition& train, double ahead_m) const {
  std::vector<LandmarkAhead> ahead;
  const auto way = route(train, 0, ahead_m);
  if (!way) return ahead;
  for (const auto& leg : way->legs()) {
    for (const auto* landmark : map_.landmarks_on(leg.run.edge->id)) {
      const double at_m = leg.begin_m + leg.run.into_m(landmark->offset_m);
      if (at_m < 0 || at_m > ahead_m) continue;
      ahead.push_back({track::seen_along(landmark->kind, leg.run.forward), landmark->name, at_m,
                       leg.run.forward ? landmark->lateral_m : -landmark->lateral_m});
    }
  }
  std::ranges::sort(ahead, {}, &LandmarkAhead::ahead_m);
  return ahead;
}

double MapView::bend_m(const track::EdgePosition& train, double ahead_m) const {
  const auto way = route(train, 0, ahead_m);
  if (!way) return 0;
  double turn_rad = 0;
  double left_m = 0;
  for (double x = 0; x < ahead_m; x += kBendStepM) {
    const double step_m = std::min(kBendStepM, ahead_m - x);
    const double before_rad = turn_rad;
    turn_rad += way->curvature_at(x + step_m / 2) * step_m;
    left_m += (before_rad + turn_rad) / 2 * step_m;
  }
  return left_m;
}

}  // namespace railfix::monitor
