#include "simulator/stage.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>

namespace railfix::simulator {
namespace {

constexpr double kNearestM = 0.4;  // in front of the camera
constexpr double kLowestSunRad = 0.08;

struct Outline {
  std::array<Eigen::Vector2d, 6> corners;
  size_t count = 0;
  void add(const Eigen::Vector2d& corner) {
    if (count < corners.size()) corners[count++] = corner;
  }
};

// The camera with the plane in front of it that everything is cut off at.
class Lens {
 public:
  explicit Lens(const geometry::View& view)
      : view_(view),
        forward_(geometry::rotation_camera_from_track(view.pose()).row(2)),
        offset_(forward_.dot(Corner(0.0, view.pose().lateral_m, view.pose().height_m)) + kNearestM) {}

  // Projects the part behind the plane (Sutherland-Hodgman).
  [[nodiscard]] Outline outline_of(const Quad& quad) const {
    Outline outline;
    for (size_t i = 0; i < quad.size(); ++i) {
      const Corner& a = quad[i];
      const Corner& b = quad[(i + 1) % quad.size()];
      const double depth_a = depth(a);
      const double depth_b = depth(b);
      if (depth_a >= 0.0) add(a, outline);
      if ((depth_a >= 0.0) != (depth_b >= 0.0)) add(a + (b - a) * (depth_a / (depth_a - depth_b)), outline);
    }
    return outline;
  }
  // A line of less than a pixel becomes one of a pixel that covers less; returns how much.
  float widen(Corner a, Corner b, double width_m, Outline& outline) const {
    const double depth_a = depth(a);
    const double depth_b = depth(b);
    if (depth_a < 0.0 && depth_b < 0.0) return 0.0F;
    const Corner cut = a + (b - a) * (depth_a / (depth_a - depth_b));
    if (depth_a < 0.0) a = cut;
    if (depth_b < 0.0) b = cut;
    const auto p = view_.project(a);
    const auto q = view_.project(b);
    if (!p || !q) return 0.0F;
    const Eigen::Vector2d along = *q - *p;
    const double length = along.norm();
    if (length < 1e-6) return 0.0F;
    const Eigen::Vector2d across(-along.y() / length, along.x() / length);
    const double wide_a = width_m * view_.camera().fu_px / (depth(a) + kNearestM);
    const double wide_b = width_m * view_.camera().fu_px / (depth(b) + kNearestM);
    outline.add(*p + 0.5 * std::max(wide_a, 1.0) * across);
    outline.add(*q + 0.5 * std::max(wide_b, 1.0) * across);
    outline.add(*q - 0.5 * std::max(wide_b, 1.0) * across);
    outline.add(*p - 0.5 * std::max(wide_a, 1.0) * across);
    return static_cast<float>(std::min(1.0, 0.5 * (wide_a + wide_b)));
  }

 private:
  [[nodiscard]] double depth(const Corner& corner) const { return forward_.dot(corner) - offset_; }
  void add(const Corner& corner, Outline& outline) const {
    if (const auto pixel = view_.project(corner)) outline.add(*pixel);
  }
  const geometry::View& view_;
  Eigen::Vector3d forward_;
  double offset_;
};

struct RowRange {
  int first = 0;
  int end = 0;
};

// Of the pixels of one row: any part is covered, and the whole pixel.
struct Span {
  int begin, whole, whole_end, end;
};

// A convex outline by its edges, grown by so many pixels.
class Shape {
 public:
  Shape(const Outline& outline, float grow_px) : grow_px_(grow_px) {
    double area = 0.0;
    for (size_t i = 0; i < outline.count; ++i) {
      const auto& p = outline.corners[i];
      const auto& q = outline.corners[(i + 1) % outline.count];
      area += p.x() * q.y() - q.x() * p.y();
      top_ = std::min(top_, p.y());
      bottom_ = std::max(bottom_, p.y());
    }
    const double sign = area > 0.0 ? 1.0 : -1.0;
    for (size_t i = 0; i < outline.count; ++i) {
      const auto& p = outline.corners[i];
      const Eigen::Vector2d along = outline.corners[(i + 1) % outline.count] - p;
      const double length = along.norm();
      if (length < 1e-9) continue;
      const double a = -sign * along.y() / length;
      const double b = sign * along.x() / length;
      edges_[count_++] = {static_cast<float>(a), static_cast<float>(b), static_cast<float>(-a * p.x() - b * p.y())};
    }
  }

  [[nodiscard]] RowRange rows(int height_px) const {
    if (count_ < 3) return {};
    return {static_cast<int>(std::clamp(top_ - 1.0, 0.0, static_cast<double>(height_px))),
            static_cast<int>(std::clamp(bottom_ + 2.0, 0.0, static_cast<double>(height_px)))};
  }
  [[nodiscard]] std::optional<Span> span(int v, int width_px) const {
    float some_left = 0.0F;
    auto some_right = static_cast<float>(width_px - 1);
    float all_left = some_left;
    float all_right = some_right;
    for (size_t i = 0; i < count_; ++i) {
      const Edge& edge = edges_[i];
      const float rest = edge.b * static_cast<float>(v) + edge.c + grow_px_;
      if (std::abs(edge.a) < 1e-6F) {
        if (rest <= 0.0F) return std::nullopt;
        if (rest < 1.0F) all_right = -1.0F;
      } else if (edge.a > 0.0F) {
        some_left = std::max(some_left, -rest / edge.a);
        all_left = std::max(all_left, (1.0F - rest) / edge.a);
      } else {
        some_right = std::min(some_right, -rest / edge.a);
        all_right = std::min(all_right, (1.0F - rest) / edge.a);
      }
    }
    if (some_left > some_right) return std::nullopt;
    const int begin = static_cast<int>(std::ceil(some_left));
    const int end = static_cast<int>(some_right) + 1;
    const int whole = std::clamp(static_cast<int>(std::ceil(all_left)), begin, end);
    return Span{begin, whole, std::clamp(static_cast<int>(all_right) + 1, whole, end), end};
  }
  [[nodiscard]] float covered(int u, int v) const {
    float inside = 1.0F;
    for (size_t i = 0; i < count_; ++i) {
      const Edge& edge = edges_[i];
      inside = std::min(inside, edge.a * static_cast<float>(u) + edge.b * static_cast<float>(v) + edge.c + grow_px_);
    }
    return std::max(0.0F, inside);
  }

 private:
  struct Edge {
    float a, b, c;  // distance inside = a u + b v + c
  };
  std::array<Edge, 6> edges_;
  size_t count_ = 0;
  float grow_px_;
  double top_ = 1e9;
  double bottom_ = -1e9;
};

// Calls blend(pixel, share) for all pixels that the outline covers; at the edges by the share covered.
template <class Blend>
void fill(const Outline& outline, float grow_px, cv::Mat& radiance, Blend blend) {
  const Shape shape(outline, grow_px);
  const RowRange rows = shape.rows(radiance.rows);
  for (int v = rows.first; v < rows.end; ++v) {
    const auto span = shape.span(v, radiance.cols);
    if (!span) continue;
    float* row = radiance.ptr<float>(v);
    for (int u = span->begin; u < span->whole; ++u) blend(row[u], shape.covered(u, v));
    for (int u = span->whole; u < span->whole_end; ++u) blend(row[u], 1.0F);
    for (int u = span->whole_end; u < span->end; ++u) blend(row[u], shape.covered(u, v));
  }
}

}  // namespace

Stage::Stage(const Line& line, const LocalTrack& main, const Illumination& light, const RenderOptions& options,
             const Shot& shot)
    : line_(line),
      main_(main),
      light_(light),
      foot_m_(shot.distance_m),
      stone_depth_m_(options.ballast_depth_m),
      verge_depth_m_(options.ballast_depth_m > options.texture_depth_m ? options.texture_depth_m + kVergeDropM
                                                                       : options.ballast_depth_m),
      foot_(line.path().at(foot_m_)),
      shadow_(-std::sin(light.open().sun_heading_rad), -std::cos(light.open().sun_heading_rad)),
      sun_(light.open().sun / std::max(1e-6, light.open().sun + light.open().sky)) {
  shadow_ /= std::tan(std::max(light.open().sun_elevation_rad, kLowestSunRad));
}

float Stage::lit(const Quad& corners, float albedo, double distance_m) const {
  const Corner middle = 0.25 * (corners[0] + corners[1] + corners[2] + corners[3]);
  const auto x = static_cast<float>(middle.x());
  return light_.on_object(static_cast<float>(distance_m - foot_m_), x, static_cast<float>(middle.y())) *
         light_.hazy(albedo, x);
}

Corner Stage::beside(const CentreLine& track, double distance_m, double lateral_m, double up_m) const {
  const double position =
      std::clamp((distance_m - track.begin_m) / kCentreStepM, 0.0, static_cast<double>(track.samples.size()) - 1.001);
  const auto index = static_cast<size_t>(position);
  const double w = position - static_cast<double>(index);
  const auto& a = track.samples[index];
  const auto& b = track.samples[index + 1];
  const double heading_rad = a.pose.heading_rad;
  const double de = a.pose.easting_m + w * (b.pose.easting_m - a.pose.easting_m) - foot_.pose.easting_m -
                    lateral_m * std::cos(heading_rad);
  const double dn = a.pose.northing_m + w * (b.pose.northing_m - a.pose.northing_m) - foot_.pose.northing_m +
                    lateral_m * std::sin(heading_rad);
  const double sin_h = std::sin(foot_.pose.heading_rad);
  const double cos_h = std::cos(foot_.pose.heading_rad);
  const double x = de * sin_h + dn * cos_h;
  const double y = -de * cos_h + dn * sin_h;
  // The world is upright; the foot's axes lean with the cant.
  const double elevation_m = a.elevation_m + w * (b.elevation_m - a.elevation_m);
  const double z = elevation_m - foot_.elevation_m - foot_.grade * x + up_m + foot_.cant_m / kRailSpacingM * y;
  return {x, y, z};
}

Corner Stage::sunk(double distance_m, double lateral_m, double depth_m) const {
  Corner corner = at(distance_m, lateral_m, 0.0);
  corner.z() =
      static_cast<double>(main_.height(static_cast<float>(corner.x()), static_cast<float>(corner.y())).z_m) - depth_m;
  return corner;
}

void Stage::bar(const Corner& from, const Corner& to, double width_m, float albedo, double order_m) {
  const Quad corners{from, to, to, to};
  faces_.push_back({corners, lit(corners, albedo, order_m), 0.5F, order_m, width_m});
}

void Stage::post(double distance_m, double lateral_m, double width_m, double top_m, float albedo) {
  bar(ground(distance_m, lateral_m), at(distance_m, lateral_m, top_m), width_m, albedo, distance_m);
}

void Stage::board(double distance_m, double lateral_m, double width_m, double bottom_m, double top_m, float albedo) {
  const double left = lateral_m + 0.5 * width_m;
  const double right = lateral_m - 0.5 * width_m;
  face({at(distance_m, left, bottom_m), at(distance_m, right, bottom_m), at(distance_m, right, top_m),
        at(distance_m, left, top_m)},
       albedo, distance_m);
}

void Stage::box(double distance_m, double lateral_m, double length_m, double width_m, double top_m, float albedo) {
  const double near = distance_m - 0.5 * length_m;
  const double far = distance_m + 0.5 * length_m;
  const double side = lateral_m > 0.0 ? -0.5 : 0.5;
  const double inner = lateral_m + side * width_m;
  const double outer = lateral_m - side * width_m;
  face({at(near, inner, top_m), at(near, outer, top_m), at(far, outer, top_m), at(far, inner, top_m)}, 1.15F * albedo,
       far);
  face({ground(near, inner), ground(far, inner), at(far, inner, top_m), at(near, inner, top_m)}, 0.7F * albedo,
       distance_m);
  face({ground(near, inner), ground(near, outer), at(near, outer, top_m), at(near, inner, top_m)}, albedo, near);
}

void Stage::shade(const Quad& corners, double strength) {
  shadows_.push_back({corners, static_cast<float>(1.0 - strength), 0.5F, 0.0, 0.0});
}

void Stage::cast(double from_m, double from_lateral_m, double to_m, double to_lateral_m, double bottom_m,
                 double top_m) {
  if (sun_ <= 0.0 || line_.depth_in_tunnel_m(from_m) > 0.0) return;
  const auto fallen = [&](double s, double d, double up) {
    const auto& main = line_.main();
    const double position =
        std::clamp((s - main.begin_m) / kCentreStepM, 0.0, static_cast<double>(main.samples.size() - 1));
    const double heading_rad = main.samples[static_cast<size_t>(position)].pose.heading_rad;
    const double along = shadow_.x() * std::sin(heading_rad) + shadow_.y() * std::cos(heading_rad);
    const double left = -shadow_.x() * std::cos(heading_rad) + shadow_.y() * std::sin(heading_rad);
    return stones(s + (up + stone_depth_m_) * along, d + (up + stone_depth_m_) * left);
  };
  shade({fallen(from_m, from_lateral_m, bottom_m), fallen(to_m, to_lateral_m, bottom_m),
         fallen(to_m, to_lateral_m, top_m), fallen(from_m, from_lateral_m, top_m)},
        sun_);
}

// Where shadows lie on each other it is as dark as in the darkest.
void Stage::paint_shadows(const geometry::View& view, cv::Mat& radiance) const {
  if (shadows_.empty()) return;
  const Lens lens(view);
  thread_local cv::Mat remaining;
  remaining.create(radiance.size(), CV_32FC1);
  remaining.setTo(1.0F);
  for (const auto& shadow : shadows_) {
    const float lost = 1.0F - shadow.radiance;
    fill(lens.outline_of(shadow.corners), shadow.grow_px, remaining,
         [lost](float& pixel, float share) { pixel = std::min(pixel, 1.0F - share * lost); });
  }
  cv::multiply(radiance, remaining, radiance);
}

void Stage::paint(const geometry::View& view, cv::Mat& radiance) {
  paint_shadows(view, radiance);
  const Lens lens(view);
  std::stable_sort(faces_.begin(), faces_.end(), [](const Face& a, const Face& b) { return a.order_m > b.order_m; });
  for (const auto& face : faces_) {
    Outline outline;
    float alpha = 1.0F;
    if (face.width_m > 0.0) {
      alpha = lens.widen(face.corners[0], face.corners[1], face.width_m, outline);
    } else {
      outline = lens.outline_of(face.corners);
    }
    if (outline.count < 3) continue;
    const float level = face.radiance;
    fill(outline, face.grow_px, radiance,
         [level, alpha](float& pixel, float share) { pixel += alpha * share * (level - pixel); });
  }
}

}  // namespace railfix::simulator
