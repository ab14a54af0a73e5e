#include "map/drawing.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>
#include <set>

namespace railfix::tool {
namespace {

using Colour = Drawing::Colour;

constexpr Colour kStraight{70, 70, 70};
constexpr Colour kClothoid{225, 120, 0};
constexpr Colour kArc{20, 90, 200};
constexpr Colour kSwitch{200, 0, 0};
constexpr Colour kBalise{0, 140, 60};
constexpr Colour kInk{0, 0, 0};
constexpr double kMarginPx = 40;
constexpr double kFootPx = 60;
constexpr double kRowPx = 18;
constexpr double kLeastLegendPx = 300;  // beside the scale bar
constexpr double kBesidePx = 50;        // of the window is drawn, too
constexpr double kLeastNamedPx = 20;
constexpr double kRoomAround = 1.05;
constexpr double kMarksFrom = 0.01;  // pixels per metre; from further away they hide the tracks
constexpr double kLetter = 0.75;     // how wide one is, of the size
constexpr double kLeastPx = 1.0;     // between drawn points
constexpr size_t kMostLabels = 150;

Colour colour_of(track::LandmarkKind kind) {
  switch (kind) {
    case track::LandmarkKind::portal_in:
    case track::LandmarkKind::portal_out:
      return {120, 60, 20};
    case track::LandmarkKind::bridge:
      return {150, 0, 150};
    case track::LandmarkKind::underbridge:
      return {215, 160, 215};
    case track::LandmarkKind::platform:
      return {0, 160, 180};
    case track::LandmarkKind::mast:
      return {150, 150, 150};
    case track::LandmarkKind::balise:
      return kBalise;
    case track::LandmarkKind::level_crossing:
      return {240, 100, 100};
    case track::LandmarkKind::frog:
      return {200, 160, 0};
    default:
      return {110, 110, 0};
  }
}

Colour colour_of(const track::Element& element) {
  if (element.curvature_start_per_m != element.curvature_end_per_m) return kClothoid;
  return element.curvature_start_per_m == 0 ? kStraight : kArc;
}

using Ends = std::pair<Eigen::Vector2d, Eigen::Vector2d>;

/// The part of a chord within a box; nothing where it passes by.
std::optional<Ends> within(const Ends& chord, const Eigen::AlignedBox2d& box) {
  const Eigen::Vector2d along = chord.second - chord.first;
  double begin = 0;
  double end = 1;
  for (const int axis : {0, 1}) {
    if (along[axis] == 0) {
      if (chord.first[axis] < box.min()[axis] || chord.first[axis] > box.max()[axis]) return std::nullopt;
      continue;
    }
    const double to_min = (box.min()[axis] - chord.first[axis]) / along[axis];
    const double to_max = (box.max()[axis] - chord.first[axis]) / along[axis];
    begin = std::max(begin, std::min(to_min, to_max));
    end = std::min(end, std::max(to_min, to_max));
  }
  if (begin >= end) return std::nullopt;
  return Ends{chord.first + begin * along, chord.first + end * along};
}

struct LegendEntry {
  Colour colour;
  std::string text;
  bool is_line = false;
  Eigen::Vector2d at = Eigen::Vector2d::Zero();
  [[nodiscard]] double length_px() const { return 42 + 7.5 * static_cast<double>(text.size()); }
};

std::vector<LegendEntry> legend() {
  using Kind = track::LandmarkKind;
  return {{kStraight, "straight", true},
          {kClothoid, "clothoid", true},
          {kArc, "arc", true},
          {kSwitch, "switch"},
          {colour_of(Kind::frog), "frog"},
          {kBalise, "balise group"},
          {colour_of(Kind::portal_in), "portal"},
          {colour_of(Kind::bridge), "bridge over"},
          {colour_of(Kind::underbridge), "bridge under"},
          {colour_of(Kind::platform), "platform"},
          {colour_of(Kind::mast), "mast"},
          {colour_of(Kind::level_crossing), "level crossing"}};
}

class Painter {
 public:
  Painter(const track::Map& map, const DrawOptions& options) : map_(map) {
    choose_window(options);
    out_.width = options.width_px;
    scale_ = (options.width_px - 2 * kMarginPx) / std::max((high_ - low_).x(), 1.0);
    const double tall = (high_ - low_).y() * scale_;
    const double most = 2.0 * options.width_px;
    if (tall > most) scale_ *= most / tall;
    const double map_px = (high_ - low_).y() * scale_ + 2 * kMarginPx;
    window_ = {Eigen::Vector2d::Zero(), Eigen::Vector2d(out_.width, map_px)};
    out_.height = std::ceil(map_px + lay_foot(map_px));
  }

  Drawing paint() {
    for (const track::Edge& edge : map_.edges) paint_edge(edge);
    if (scale_ >= kMarksFrom) paint_marks();
    paint_lines_names();
    paint_foot();
    return std::move(out_);
  }

 private:
  void paint_marks() {
    for (const track::Landmark& mark : map_.landmarks) paint_landmark(mark);
    for (const track::BaliseGroup& group : map_.balise_groups) paint_group(group);
    for (const track::Node& node : map_.nodes) paint_node(node);
  }
  void choose_window(const DrawOptions& options) {
    if (options.around) {
      const track::PlanPose pose = map_.edge(options.around->edge)->alignment.at(options.around->offset_m).pose;
      const Eigen::Vector2d middle(pose.easting_m, pose.northing_m);
      choose_all();
      // No further than there is anything to see.
      const double reach_m = std::max((middle - low_).maxCoeff(), (high_ - middle).maxCoeff());
      const double radius_m = std::min(options.radius_m, std::max(1.0, kRoomAround * reach_m));
      low_ = middle.array() - radius_m;
      high_ = middle.array() + radius_m;
      return;
    }
    choose_all();
    // A straight map still gets a strip to be drawn in.
    const double least = 0.05 * (high_ - low_).maxCoeff();
    const Eigen::Vector2d grow = (0.5 * (Eigen::Vector2d::Constant(least) - (high_ - low_))).cwiseMax(0.0);
    low_ -= grow;
    high_ += grow;
  }
  void choose_all() {
    low_.setConstant(std::numeric_limits<double>::infinity());
    high_ = -low_;
    for (const track::Edge& edge : map_.edges) {
      for (double part = 0; part <= 1; part += 0.125) {
        const track::PlanPose pose = edge.alignment.at(part * edge.alignment.length_m()).pose;
        const Eigen::Vector2d at(pose.easting_m, pose.northing_m);
        low_ = low_.cwiseMin(at);
        high_ = high_.cwiseMax(at);
      }
    }
  }

  [[nodiscard]] Eigen::Vector2d pixel(double easting_m, double northing_m) const {
    return {kMarginPx + (easting_m - low_.x()) * scale_, kMarginPx + (high_.y() - northing_m) * scale_};
  }
  [[nodiscard]] bool is_inside(const Eigen::Vector2d& at) const { return window_.exteriorDistance(at) < kBesidePx; }
  [[nodiscard]] Eigen::Vector2d pixel_on(uint32_t edge, double offset_m, double lateral_m) const {
    const track::PlanPose pose = map_.edge(edge)->alignment.at(offset_m).pose;
    return pixel(pose.easting_m - lateral_m * std::cos(pose.heading_rad),
                 pose.northing_m + lateral_m * std::sin(pose.heading_rad));
  }

  /// An element as chords that stay within a fifth of a pixel of the track.
  [[nodiscard]] std::vector<Eigen::Vector2d> chords_of(const track::Alignment& track, size_t index) const {
    const track::Element& element = track.elements()[index];
    const double sharpest = std::max(std::abs(element.curvature_start_per_m), std::abs(element.curvature_end_per_m));
    const double step = std::clamp(std::sqrt(1.6 / std::max(scale_ * sharpest, 1e-9)), kLeastPx / scale_, 1e6);
    const double count = std::ceil(element.length_m / step);
    std::vector<Eigen::Vector2d> points;
    for (double k = 0; k <= count; ++k) {
      const track::PlanPose pose = track::advance(track.starts()[index], element, element.length_m * k / count);
      points.push_back(pixel(pose.easting_m, pose.northing_m));
    }
    return points;
  }

  void paint_edge(const track::Edge& edge) {
    const Eigen::Vector2d beside = Eigen::Vector2d::Constant(kBesidePx);
    const Eigen::AlignedBox2d room(window_.min() - beside, window_.max() + beside);
    for (size_t i = 0; i < edge.alignment.elements().size(); ++i) {
      Drawing::Line line{chords_of(edge.alignment, i), colour_of(edge.alignment.elements()[i]), track_width()};
      // A long straight may cross the window with both ends far outside.
      if (line.points.size() == 2) {
        const auto seen = within({line.points[0], line.points[1]}, room);
        if (!seen) continue;
        line.points = {seen->first, seen->second};
      }
      if (std::ranges::any_of(line.points, [&](const auto& at) { return is_inside(at); }) || line.points.size() == 2)
        out_.lines.push_back(std::move(line));
    }
  }

  [[nodiscard]] double track_width() const { return scale_ > 0.5 ? 2.5 : 1.3; }
  /// Marks shrink where they would hide the tracks.
  [[nodiscard]] double mark_radius() const { return std::clamp(8.0 * scale_, 1.2, 4.0); }

  void paint_landmark(const track::Landmark& mark) {
    if (map_.edge(mark.edge) == nullptr) return;
    if (mark.kind == track::LandmarkKind::mast && scale_ < 0.05) return;
    // From further away it lies under its switch.
    if (mark.kind == track::LandmarkKind::frog && scale_ < 0.3) return;
    const Eigen::Vector2d at = pixel_on(mark.edge, mark.offset_m, mark.lateral_m);
    if (is_inside(at)) out_.dots.push_back({at, colour_of(mark.kind), 0.7 * mark_radius(), true});
  }

  void paint_group(const track::BaliseGroup& group) {
    const Eigen::Vector2d at = pixel_on(group.edge, group.offset_m, 0);
    if (!is_inside(at)) return;
    out_.dots.push_back({at, kBalise, 1.2 * mark_radius(), !group.is_virtual});
    if (scale_ > 0.05) add_label(at, std::to_string(group.nid_c) + "/" + std::to_string(group.nid_bg), 9);
  }

  void paint_node(const track::Node& node) {
    if (node.kind != track::NodeKind::railway_switch) return;
    const Eigen::Vector2d at = pixel(node.easting_m, node.northing_m);
    if (!is_inside(at)) return;
    out_.dots.push_back({at, kSwitch, mark_radius(), true});
    if (scale_ > 0.08 && !node.name.empty()) add_label(at, node.name, 11);
  }

  /// In its middle, else on the longest chord that is in the picture; nothing where that is short.
  [[nodiscard]] std::optional<Eigen::Vector2d> place_of_name(const track::Edge& edge) const {
    const Eigen::Vector2d middle = pixel_on(edge.id, 0.5 * edge.alignment.length_m(), 0);
    if (window_.contains(middle)) return middle;
    std::optional<Eigen::Vector2d> place;
    double longest_px = kLeastNamedPx;
    for (size_t i = 0; i < edge.alignment.elements().size(); ++i) {
      const auto points = chords_of(edge.alignment, i);
      for (size_t k = 1; k < points.size(); ++k) {
        const auto seen = within({points[k - 1], points[k]}, window_);
        const double seen_px = seen ? (seen->second - seen->first).norm() : 0;
        if (seen_px <= longest_px) continue;
        longest_px = seen_px;
        place = 0.5 * (seen->first + seen->second);
      }
    }
    return place;
  }

  /// Every line once, on its longest edge.
  void paint_lines_names() {
    std::vector<const track::Edge*> edges;
    for (const track::Edge& edge : map_.edges) edges.push_back(&edge);
    std::sort(edges.begin(), edges.end(),
              [](const auto* a, const auto* b) { return a->alignment.length_m() > b->alignment.length_m(); });
    std::set<std::string> named;
    for (const track::Edge* edge : edges) {
      if (edge->alignment.length_m() * scale_ < 60) break;
      const std::string& name = edge->line.empty() ? edge->name : edge->line;
      if (named.contains(name)) continue;
      const auto at = place_of_name(*edge);
      if (!at) continue;
      named.insert(name);
      add_label(*at, name, 13);
    }
  }

  /// Labels that would lie on others are left out.
  void add_label(const Eigen::Vector2d& at, const std::string& text, double size) {
    if (out_.labels.size() >= kMostLabels) return;
    const double length_px = kLetter * size * static_cast<double>(text.size());
    const bool fits = at.x() + 6 + length_px < out_.width;
    const Eigen::Vector2d place = at + Eigen::Vector2d(fits ? 6 : -6 - length_px, -5);
    for (const Drawing::Label& other : out_.labels) {
      const bool beside = std::abs(other.at.y() - place.y()) > size ||
                          other.at.x() + kLetter * other.size * static_cast<double>(other.text.size()) < place.x() ||
                          place.x() + length_px < other.at.x();
      if (!beside) return;
    }
    out_.labels.push_back({place, text, size});
  }

  /// A round length, a fifth of the picture at most.
  [[nodiscard]] double bar_m() const {
    const double wanted_m = 0.2 * out_.width / scale_;
    const double length_m = std::pow(10.0, std::floor(std::log10(wanted_m)));
    for (const double factor : {5.0, 2.0}) {
      if (length_m * factor <= wanted_m) return length_m * factor;
    }
    return length_m;
  }

  /// The legend stands beside the scale bar, or below it where that leaves no room; gives the foot's height.
  double lay_foot(double top_px) {
    const double beside_px = kMarginPx + bar_m() * scale_ + 40;
    const bool is_wide = out_.width - beside_px > kLeastLegendPx;
    const double begin_px = is_wide ? beside_px : kMarginPx;
    Eigen::Vector2d at(begin_px, top_px + (is_wide ? 20 : kFootPx));
    legend_ = legend();
    for (LegendEntry& entry : legend_) {
      if (at.x() + entry.length_px() > out_.width && at.x() > begin_px) at = {begin_px, at.y() + kRowPx};
      entry.at = at;
      at.x() += entry.length_px();
    }
    return std::max(kFootPx, at.y() - top_px + kRowPx);
  }

  void paint_foot() {
    const double y = window_.max().y() + 0.5 * kFootPx;
    const double right = kMarginPx + bar_m() * scale_;
    out_.lines.push_back({{{kMarginPx, y - 5}, {kMarginPx, y}, {right, y}, {right, y - 5}}, kInk, 2});
    const bool in_km = bar_m() >= 1000;
    char length[32];
    std::snprintf(length, sizeof length, "%g %s", in_km ? bar_m() / 1000 : bar_m(), in_km ? "km" : "m");
    out_.labels.push_back({{kMarginPx, y + 16}, length, 12});
    for (const LegendEntry& entry : legend_) {
      const auto& at = entry.at;
      if (entry.is_line) out_.lines.push_back({{at, at + Eigen::Vector2d(24, 0)}, entry.colour, 3});
      if (!entry.is_line) out_.dots.push_back({at + Eigen::Vector2d(12, 0), entry.colour, 4, true});
      out_.labels.push_back({at + Eigen::Vector2d(30, 4), entry.text, 12});
    }
  }

  const track::Map& map_;
  Drawing out_;
  Eigen::Vector2d low_ = Eigen::Vector2d::Zero();
  Eigen::Vector2d high_ = Eigen::Vector2d::Zero();
  Eigen::AlignedBox2d window_;  // of the map, in the picture
  std::vector<LegendEntry> legend_;
  double scale_ = 1;  // pixels per metre
};

}  // namespace

Drawing draw_map(const track::Map& map, const DrawOptions& options) {
  return Painter(map, options).paint();
}

}  // namespace railfix::tool
