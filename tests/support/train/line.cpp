#include "support/train/line.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

namespace railfix::train {
namespace {

using track::Element;
using track::PlanPose;

constexpr double kBesideM = 4.5;
constexpr double kProfileM = 800;
constexpr double kMapSigmaM = 0.1;
constexpr double kWrongOnMap = 0.03;

std::vector<Element> random_elements(core::Random& random, double length_m) {
  std::vector<Element> elements;
  double sum_m = 0;
  while (sum_m < length_m) {
    const double curvature = (random.uniform() < 0.5 ? -1 : 1) / random.uniform(400, 2500);
    for (const auto& e : {Element{random.uniform(150, 900), 0, 0}, Element{80, 0, curvature},
                          Element{random.uniform(80, 500), curvature, curvature}, Element{80, curvature, 0}}) {
      elements.push_back(e);
      sum_m += e.length_m;
    }
  }
  return elements;
}

double length_of(const std::vector<Element>& elements) {
  double sum_m = 0;
  for (const auto& e : elements) sum_m += e.length_m;
  return sum_m;
}

/// Lays the way edge by edge, with the legs that it does not take.
class Layer {
 public:
  Layer(core::Random& random, const PlanPose& pose, std::vector<track::GradePoint> profile)
      : random_(random), pose_(pose), profile_(std::move(profile)) {
    line_.map = std::make_shared<track::Map>();
    node_ = new_node(track::NodeKind::end, pose_);
  }

  void lay(const Element& element) {
    elements_.push_back(element);
    laid_m_ += element.length_m;
  }

  void loop() {
    const auto stem = end_edge(track::NodeKind::railway_switch);
    const auto facing = node_;
    const double radius_m = random_.uniform(500, 1200);
    const double side = random_.uniform() < 0.5 ? -1 : 1;
    const double beside_m = random_.uniform(150, 900);
    // Two arcs lead 4.5 m to the side, two back.
    const double angle_rad = std::acos(1 - kBesideM / (2 * radius_m));
    const Element out{radius_m * angle_rad, side / radius_m, side / radius_m};
    const Element back{radius_m * angle_rad, -side / radius_m, -side / radius_m};
    std::vector<Element> straight{{4 * radius_m * std::sin(angle_rad) + beside_m, 0, 0}};
    std::vector<Element> diverging{out, back, {beside_m, 0, 0}, back, out};
    const bool diverges = random_.uniform() < 0.5;
    const auto other = other_leg(stem, diverges ? straight : diverging, !diverges);
    elements_ = diverges ? diverging : straight;
    const auto own = end_edge(track::NodeKind::railway_switch);
    connect(facing, stem, own, diverges);
    line_.map->edges[other - 1].to_node = node_;
    pose_ = track::advance(begin_, straight.front(), straight.front().length_m);
    const uint32_t next = static_cast<uint32_t>(line_.map->edges.size()) + 1;
    connect(node_, own, next, diverges);
    connect(node_, other, next, !diverges);
  }

  /// The other leg is as long as `rest_m`.
  void junction(double rest_m) {
    const auto stem = end_edge(track::NodeKind::railway_switch);
    const double curvature = (random_.uniform() < 0.5 ? -1 : 1) / random_.uniform(500, 1200);
    const Element turnout{random_.uniform(50, 90), curvature, curvature};
    const bool diverges = random_.uniform() < 0.5;
    auto elements = random_elements(random_, rest_m);
    if (!diverges) elements.insert(elements.begin(), turnout);
    // The way's edge is the next to be laid, behind the other leg's.
    const double other_m = length_of(elements);
    auto& other = line_.map->edges[other_leg(stem, std::move(elements), !diverges) - 1];
    other.to_node = new_node(track::NodeKind::end, other.alignment.at(other_m).pose);
    connect(node_, stem, static_cast<uint32_t>(line_.map->edges.size()) + 1, diverges);
    if (diverges) lay(turnout);
  }

  RandomLine take() {
    end_edge(track::NodeKind::end);
    return std::move(line_);
  }
  [[nodiscard]] double laid_m() const { return laid_m_; }

 private:
  uint32_t new_node(track::NodeKind kind, const PlanPose& pose) {
    const auto id = static_cast<uint32_t>(line_.map->nodes.size()) + 1;
    line_.map->nodes.push_back({id, kind, "", pose.easting_m, pose.northing_m});
    return id;
  }
  void connect(uint32_t node, uint32_t from, uint32_t to, bool diverging) {
    line_.map->connections.push_back({node, from, to, diverging});
  }
  [[nodiscard]] std::vector<track::GradePoint> profile_from(double begin_m) const {
    auto profile = profile_;
    for (auto& point : profile) point.offset_m -= begin_m;
    return profile;
  }
  /// From the last node; where it leads to is said later.
  uint32_t add_edge(const char* name, std::vector<Element> elements) {
    const auto id = static_cast<uint32_t>(line_.map->edges.size()) + 1;
    line_.map->edges.push_back({id, name + std::to_string(id), node_, 0, "",
                                track::Alignment::chained(pose_, std::move(elements), profile_from(edge_begin_m_))});
    return id;
  }
  /// Of the way, from the last node to a new one; its id.
  uint32_t end_edge(track::NodeKind kind) {
    const double length_m = length_of(elements_);
    const auto id = add_edge("line ", std::exchange(elements_, {}));
    line_.way.push_back(id);
    begin_ = std::exchange(pose_, line_.map->edges.back().alignment.at(length_m).pose);
    node_ = new_node(kind, pose_);
    line_.map->edges.back().to_node = node_;
    edge_begin_m_ += length_m;
    laid_m_ = edge_begin_m_;
    return id;
  }
  uint32_t other_leg(uint32_t stem, std::vector<Element> elements, bool diverging) {
    const auto id = add_edge("leg ", std::move(elements));
    connect(node_, stem, id, diverging);
    return id;
  }

  core::Random& random_;
  PlanPose pose_;   // of the edge that is being laid
  PlanPose begin_;  // of the one before
  std::vector<track::GradePoint> profile_;
  RandomLine line_;
  std::vector<Element> elements_;
  uint32_t node_ = 0;
  double edge_begin_m_ = 0;
  double laid_m_ = 0;
};

}  // namespace

RandomLine random_line(core::Random& random, double length_m, double switch_spacing_m, double first_switch_m) {
  const auto elements = random_elements(random, length_m);
  std::vector<track::GradePoint> profile;
  double elevation_m = 400;
  for (double offset_m = 0; offset_m < length_of(elements); offset_m += kProfileM) {
    profile.push_back({offset_m, elevation_m, 100});
    elevation_m += kProfileM * random.uniform(-0.015, 0.015);
  }
  Layer layer(random, {1000, 2000, random.uniform(0, 6)}, std::move(profile));
  double next_m = std::max(switch_spacing_m * 0.5, first_switch_m);
  for (const auto& element : elements) {
    // Points lie in straights.
    const bool straight = element.curvature_start_per_m == 0 && element.curvature_end_per_m == 0;
    layer.lay(element);
    if (switch_spacing_m <= 0 || !straight || layer.laid_m() < next_m) continue;
    random.uniform() < 0.5 ? layer.loop() : layer.junction(length_m);
    next_m = layer.laid_m() + switch_spacing_m * random.uniform(0.5, 1.5);
  }
  return layer.take();
}

void furnish(RandomLine& line, core::Random& random) {
  auto& landmarks = line.map->landmarks;
  const auto put = [&](const Thing& thing, double mapped_m) {
    const auto id = static_cast<uint32_t>(landmarks.size()) + 1;
    landmarks.push_back({id, thing.kind, thing.edge, mapped_m, thing.lateral_m, kMapSigmaM, ""});
  };
  for (const auto& edge : line.map->edges) {
    const double end_m = edge.alignment.length_m() - 1;
    for (double m = random.uniform(0, 65); m < end_m; m += random.uniform(40, 65)) {
      line.things.push_back({track::LandmarkKind::mast, edge.id, m, kMastBesideM});
      const double moved_m = (random.uniform() < 0.5 ? -1 : 1) * random.uniform(1, 6);
      const double mapped_m = m + kMapSigmaM * random.normal() + (random.uniform() < kWrongOnMap ? moved_m : 0);
      put(line.things.back(), std::clamp(mapped_m, 0.0, end_m));
    }
    for (double m = random.uniform(0, 1600); m + 3 < end_m; m += random.uniform(400, 1600)) {
      for (const double balise_m : {m, m + 3}) {
        const Thing balise{track::LandmarkKind::balise, edge.id, balise_m, 0};
        const double luck = random.uniform();
        const double mapped_m = balise_m + kMapSigmaM * random.normal();
        if (luck < 1 - kWrongOnMap) line.things.push_back(balise);
        if (luck > kWrongOnMap) put(balise, std::max(mapped_m, 0.0));
      }
    }
  }
}

}  // namespace railfix::train
