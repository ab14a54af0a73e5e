#include "map/drawing.hpp"

#include <algorithm>
#include <cmath>
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
constexpr double kLetter = 0.75;  // how wide one is, of the size
constexpr double kLeastPx = 1.0;  // between drawn points
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

class Painter {
 public:
  Painter(const track::Map& map, const DrawOptions& options) : map_(map) {
    choose_window(options);
    out_.width = options.width_px;
    scale_ = (options.width_px - 2 * kMarginPx) / std::max((high_ - low_).x(), 1.0);
    const double tall = (high_ - low_).y() * scale_;
    const double most = 2.0 * options.width_px;
    if (tall > most) scale_ *= most / tall;
    out_.height = std::ceil((high_ - low_).y() * scale_ + 2 * kMarginPx + kFootPx);
  }

  Drawing paint() {
    for (const track::Edge& edge : map_.edges) paint_edge(edge);
    for (const track::Landmark& mark : map_.landmarks) paint_landmark(mark);
    for (const track::BaliseGroup& group : map_.balise_groups) paint_group(group);
    for (const track::Node& node : map_.nodes) paint_node(node);
    paint_lines_names();
    paint_foot();
    return std::move(out_);
  }

 private:
  void choose_window(const DrawOptions& options) {
    if (options.around) {
      const track::PlanPose pose = map_.edge(options.around->edge)->alignment.at(options.around->offset_m).pose;
      const Eigen::Vector2d middle(pose.easting_m, pose.northing_m);
      low_ = middle.array() - options.radius_m;
      high_ = middle.array() + options.radius_m;
      return;
    }
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
    // A straight map still gets a strip to be drawn in.
    const double least = 0.05 * (high_ - low_).maxCoeff();
    const Eigen::Vector2d grow = (0.5 * (Eigen::Vector2d::Constant(least) - (high_ - low_))).cwiseMax(0.0);
    low_ -= grow;
    high_ += grow;
  }

  [[nodiscard]] Eigen::Vector2d pixel(double easting_m, double northing_m) const {
    return {kMarginPx + (easting_m - low_.x()) * scale_, kMarginPx + (high_.y() - northing_m) * scale_};
  }
  [[nodiscard]] bool is_inside(const Eigen::Vector2d& at) const {
    return at.x() > -50 && at.y() > -50 && at.x() < out_.width + 50 && at.y() < out_.height - kFootPx + 50;
  }
  [[nodiscard]] Eigen::Vector2d pixel_on(uint32_t edge, double offset_m, double lateral_m) const {
    const track::PlanPose pose = map_.edge(edge)->alignment.at(offset_m).pose;
    return pixel(pose.easting_m - lateral_m * std::cos(pose.heading_rad),
                 pose.northing_m + lateral_m * std::sin(pose.heading_rad));
  }

  void paint_edge(const track::Edge& edge) {
    const track::Alignment& track = edge.alignment;
    for (size_t i = 0; i < track.elements().size(); ++i) {
      const track::Element& element = track.elements()[i];
      const double sharpest = std::max(std::abs(element.curvature_start_per_m), std::abs(element.curvature_end_per_m));
      // Chords that stay within a fifth of a pixel of the track.
      const double step = std::clamp(std::sqrt(1.6 / std::max(scale_ * sharpest, 1e-9)), kLeastPx / scale_, 1e6);
      const double count = std::ceil(element.length_m / step);
      Drawing::Line line{{}, colour_of(element), track_width()};
      bool visible = false;
      for (double k = 0; k <= count; ++k) {
        const track::PlanPose pose = track::advance(track.starts()[i], element, element.length_m * k / count);
        line.points.push_back(pixel(pose.easting_m, pose.northing_m));
        visible = visible || is_inside(line.points.back());
      }
      // A long straight may cross the window with both ends outside.
      if (visible || count == 1) out_.lines.push_back(std::move(line));
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

  /// Every line once, at the middle of its longest edge.
  void paint_lines_names() {
    std::vector<const track::Edge*> edges;
    for (const track::Edge& edge : map_.edges) edges.push_back(&edge);
    std::sort(edges.begin(), edges.end(),
              [](const auto* a, const auto* b) { return a->alignment.length_m() > b->alignment.length_m(); });
    std::set<std::string> named;
    for (const track::Edge* edge : edges) {
      if (edge->alignment.length_m() * scale_ < 60) break;
      const std::string& name = edge->line.empty() ? edge->name : edge->line;
      const Eigen::Vector2d at = pixel_on(edge->id, 0.5 * edge->alignment.length_m(), 0);
      if (is_inside(at) && named.insert(name).second) add_label(at, name, 13);
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

  void paint_foot() {
    const double y = out_.height - 0.5 * kFootPx;
    const double wanted_m = 0.2 * out_.width / scale_;
    double length_m = std::pow(10.0, std::floor(std::log10(wanted_m)));
    for (const double factor : {5.0, 2.0}) {
      if (length_m * factor <= wanted_m) {
        length_m *= factor;
        break;
      }
    }
    const double right = kMarginPx + length_m * scale_;
    out_.lines.push_back({{{kMarginPx, y - 5}, {kMarginPx, y}, {right, y}, {right, y - 5}}, kInk, 2});
    const bool in_km = length_m >= 1000;
    out_.labels.push_back(
        {{kMarginPx, y + 16},
         std::to_string(static_cast<int>(std::lround(in_km ? length_m / 1000 : length_m))) + (in_km ? " km" : " m"),
         12});
    double x = right + 40;
    double row_y = y - 10;
    const auto entry = [&](const Colour& colour, const std::string& text, bool is_line) {
      const double length_px = 42 + 7.5 * static_cast<double>(text.size());
      if (x + length_px > out_.width) {
        x = right + 40;
        row_y += 18;
      }
      if (is_line) out_.lines.push_back({{{x, row_y}, {x + 24, row_y}}, colour, 3});
      if (!is_line) out_.dots.push_back({{x + 12, row_y}, colour, 4, true});
      out_.labels.push_back({{x + 30, row_y + 4}, text, 12});
      x += length_px;
    };
    entry(kStraight, "straight", true);
    entry(kClothoid, "clothoid", true);
    entry(kArc, "arc", true);
    entry(kSwitch, "switch", false);
    entry(colour_of(track::LandmarkKind::frog), "frog", false);
    entry(kBalise, "balise group", false);
    entry(colour_of(track::LandmarkKind::portal_in), "portal", false);
    entry(colour_of(track::LandmarkKind::bridge), "bridge over", false);
    entry(colour_of(track::LandmarkKind::underbridge), "bridge under", false);
    entry(colour_of(track::LandmarkKind::platform), "platform", false);
    entry(colour_of(track::LandmarkKind::mast), "mast", false);
    entry(colour_of(track::LandmarkKind::level_crossing), "level crossing", false);
  }

  const track::Map& map_;
  Drawing out_;
  Eigen::Vector2d low_ = Eigen::Vector2d::Zero();
  Eigen::Vector2d high_ = Eigen::Vector2d::Zero();
  double scale_ = 1;  // pixels per metre
};

}  // namespace

Drawing draw_map(const track::Map& map, const DrawOptions& options) {
  return Painter(map, options).paint();
}

}  // namespace railfix::tool
