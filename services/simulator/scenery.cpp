#include "simulator/scenery.hpp"

#include <algorithm>
#include <array>
#include <cmath>

namespace railfix::simulator {
namespace {

constexpr double kNearX = 0.6;
constexpr double kGrowPx = 0.9;  // 0.5 is exact; a little more closes the seams between neighbours
constexpr double kFarX = 245.0;
constexpr double kTunnelHalfWidthM = 2.7;
constexpr double kTunnelHeightM = 5.8;
constexpr double kPlatformLateralM = 1.67;
constexpr double kPlatformHeightM = 0.38;

using Corner = Eigen::Vector3d;
struct Face {
  std::vector<Corner> corners;  // convex, track axes of the foot
  float grey = 0;
  double order_m = 0;  // painted from the largest to the smallest
};

// Keeps the part in front of the camera (Sutherland-Hodgman with one plane).
std::vector<Corner> in_front(const std::vector<Corner>& corners) {
  std::vector<Corner> kept;
  for (size_t i = 0; i < corners.size(); ++i) {
    const Corner& a = corners[i];
    const Corner& b = corners[(i + 1) % corners.size()];
    if (a.x() >= kNearX) kept.push_back(a);
    if ((a.x() >= kNearX) != (b.x() >= kNearX)) kept.push_back(a + (b - a) * ((kNearX - a.x()) / (b.x() - a.x())));
  }
  return kept;
}

// Fills a convex polygon; pixels at the edges by the share they are covered.
void paint(const std::vector<Eigen::Vector2d>& polygon, float grey, cv::Mat& radiance) {
  double area = 0.0;
  double top = 1e9;
  double bottom = -1e9;
  double left = 1e9;
  double right = -1e9;
  for (size_t i = 0; i < polygon.size(); ++i) {
    const auto& a = polygon[i];
    const auto& b = polygon[(i + 1) % polygon.size()];
    area += a.x() * b.y() - b.x() * a.y();
    top = std::min(top, a.y());
    bottom = std::max(bottom, a.y());
    left = std::min(left, a.x());
    right = std::max(right, a.x());
  }
  const int first_row = std::max(0, static_cast<int>(std::max(top, -1.0)));
  const int last_row = std::min(radiance.rows - 1, static_cast<int>(std::min(bottom, 1e6)) + 1);
  const int first_column = std::max(0, static_cast<int>(std::max(left, -1.0)));
  const int last_column = std::min(radiance.cols - 1, static_cast<int>(std::min(right, 1e6)) + 1);
  const double sign = area > 0.0 ? 1.0 : -1.0;
  for (int v = first_row; v <= last_row; ++v) {
    float* row = radiance.ptr<float>(v);
    for (int u = first_column; u <= last_column; ++u) {
      double inside = 1.0;
      for (size_t i = 0; i < polygon.size(); ++i) {
        const auto& a = polygon[i];
        const Eigen::Vector2d edge = polygon[(i + 1) % polygon.size()] - a;
        const double length = edge.norm();
        if (length < 1e-9) continue;
        inside = std::min(inside, sign * (edge.x() * (v - a.y()) - edge.y() * (u - a.x())) / length);
      }
      const float share = static_cast<float>(std::clamp(inside + kGrowPx, 0.0, 1.0));
      row[u] += share * (grey - row[u]);
    }
  }
}

class Stage {
 public:
  Stage(const Line& line, const Illumination& light, double foot_m)
      : line_(line), light_(light), foot_m_(foot_m), foot_(line.path().at(foot_m)) {}

  // Point beside the path, `up_m` over its rails, in the foot's track axes.
  [[nodiscard]] Corner at(double distance_m, double lateral_m, double up_m) const {
    const auto& main = line_.main();
    const double position =
        std::clamp((distance_m - main.begin_m) / kCentreStepM, 0.0, static_cast<double>(main.samples.size()) - 2.0);
    const auto& sample = main.samples[static_cast<size_t>(position)];
    const auto place =
        track::advance(sample.pose, track::Element{1.0, 0.0, 0.0}, (position - std::floor(position)) * kCentreStepM);
    const double de = place.easting_m - foot_.pose.easting_m - lateral_m * std::cos(place.heading_rad);
    const double dn = place.northing_m - foot_.pose.northing_m + lateral_m * std::sin(place.heading_rad);
    const double sin_h = std::sin(foot_.pose.heading_rad);
    const double cos_h = std::cos(foot_.pose.heading_rad);
    const double x = de * sin_h + dn * cos_h;
    const double y = -de * cos_h + dn * sin_h;
    // The world is upright; the foot's axes lean with the cant.
    const double z = sample.elevation_m - foot_.elevation_m - foot_.grade * x + up_m + foot_.cant_m / kRailSpacingM * y;
    return {x, y, z};
  }
  [[nodiscard]] bool seen(double distance_m) const {
    return distance_m - foot_m_ > 0.0 && distance_m - foot_m_ < kFarX;
  }
  void add(std::vector<Corner> corners, float albedo, double distance_m) {
    Corner middle = Corner::Zero();
    for (const auto& corner : corners) middle += corner / static_cast<double>(corners.size());
    const auto x = static_cast<float>(middle.x());
    const float light = light_.on_object(static_cast<float>(distance_m - foot_m_), x, static_cast<float>(middle.y()));
    faces_.push_back({std::move(corners), light * light_.hazy(albedo, x), distance_m});
  }

  // Steps through a span from far to near, as the picture needs.
  template <class Each>
  void along(const Span& span, double step_m, Each each) {
    const double begin = std::max(span.begin_m, foot_m_ - 2.0);
    const double end = std::min(span.end_m, foot_m_ + kFarX);
    for (double s = begin; s < end; s += step_m) each(s, std::min(s + step_m, end));
  }
  [[nodiscard]] double foot_m() const { return foot_m_; }

  void paint_all(const geometry::View& view, cv::Mat& radiance) {
    std::stable_sort(faces_.begin(), faces_.end(), [](const Face& a, const Face& b) { return a.order_m > b.order_m; });
    for (const auto& face : faces_) {
      std::vector<Eigen::Vector2d> polygon;
      for (const auto& corner : in_front(face.corners)) {
        if (const auto pixel = view.project(corner)) polygon.push_back(*pixel);
      }
      if (polygon.size() > 2) paint(polygon, face.grey, radiance);
    }
  }

 private:
  const Line& line_;
  const Illumination& light_;
  double foot_m_;
  track::TrackPoint foot_;
  std::vector<Face> faces_;
};

void add_masts(const Line& line, Stage& stage) {
  for (const auto& mast : line.masts()) {
    if (!stage.seen(mast.distance_m)) continue;
    const double s = mast.distance_m;
    const double d = mast.lateral_m;
    stage.add({stage.at(s, d - 0.13, -0.3), stage.at(s, d + 0.13, -0.3), stage.at(s, d + 0.13, 7.5),
               stage.at(s, d - 0.13, 7.5)},
              0.33F, s);
    const double arm = d > 0.0 ? -0.3 : 0.3;
    stage.add({stage.at(s, d, 6.3), stage.at(s, d, 6.4), stage.at(s, arm, 5.9), stage.at(s, arm, 5.8)}, 0.25F, s);
  }
}

void add_platforms(const Line& line, Stage& stage) {
  for (const auto& platform : line.platforms()) {
    const double side = platform.lateral_m < 0.0 ? -1.0 : 1.0;
    const double edge = side * kPlatformLateralM;
    stage.along(platform, 3.0, [&](double a, double b) {
      const auto strip = [&](double from, double to, float grey) {
        stage.add({stage.at(a, from, kPlatformHeightM), stage.at(b, from, kPlatformHeightM),
                   stage.at(b, to, kPlatformHeightM), stage.at(a, to, kPlatformHeightM)},
                  grey, a);
      };
      const float shade = 0.02F * unit_float(mix_bits(77, std::llround(a / 3.0)));
      strip(edge + side * 0.9, edge + side * 4.5, 0.50F + shade);
      strip(edge + side * 0.75, edge + side * 0.9, 0.86F);
      strip(edge, edge + side * 0.75, 0.58F + shade);
      stage.add({stage.at(a, edge, -0.25), stage.at(b, edge, -0.25), stage.at(b, edge, kPlatformHeightM),
                 stage.at(a, edge, kPlatformHeightM)},
                0.26F + shade, a);
    });
  }
}

void add_wall_across(Stage& stage, double s, double half_gap_m, double under_m, double half_width_m, double over_m,
                     float grey) {
  for (const double side : {-1.0, 1.0}) {
    stage.add({stage.at(s, side * half_gap_m, -0.5), stage.at(s, side * half_width_m, -0.5),
               stage.at(s, side * half_width_m, over_m), stage.at(s, side * half_gap_m, over_m)},
              grey, s);
  }
  stage.add({stage.at(s, -half_gap_m, under_m), stage.at(s, half_gap_m, under_m), stage.at(s, half_gap_m, over_m),
             stage.at(s, -half_gap_m, over_m)},
            grey, s);
}

void add_tunnels(const Line& line, Stage& stage) {
  for (const auto& tunnel : line.tunnels()) {
    if (stage.seen(tunnel.begin_m)) {
      add_wall_across(stage, tunnel.begin_m, 8.0, 7.5, 30.0, 13.0, 0.34F);
      add_wall_across(stage, tunnel.begin_m, kTunnelHalfWidthM, kTunnelHeightM, 8.0, 8.0, 0.55F);
    }
    const double ahead = tunnel.begin_m - stage.foot_m();
    if (ahead > kFarX || tunnel.end_m < stage.foot_m()) continue;
    stage.along(tunnel, 2.5, [&](double a, double b) {
      const float shade = 0.85F + 0.3F * unit_float(mix_bits(91, std::llround(a / 2.5)));
      const double w = kTunnelHalfWidthM;
      const double h = kTunnelHeightM;
      for (const double side : {-1.0, 1.0}) {
        stage.add({stage.at(a, side * w, -0.3), stage.at(b, side * w, -0.3), stage.at(b, side * w, h),
                   stage.at(a, side * w, h)},
                  0.42F * shade, a);
      }
      stage.add({stage.at(a, -w, h), stage.at(b, -w, h), stage.at(b, w, h), stage.at(a, w, h)}, 0.30F * shade, a);
    });
    // Behind the far end of the sight nothing of the outside shows.
    if (tunnel.end_m > stage.foot_m() + kFarX) {
      const double s = stage.foot_m() + kFarX;
      stage.add({stage.at(s, -3.0, -1.0), stage.at(s, 3.0, -1.0), stage.at(s, 3.0, 6.0), stage.at(s, -3.0, 6.0)}, 0.01F,
                s);
    }
  }
}

void add_bridges(const Line& line, Stage& stage) {
  for (const auto& bridge : line.bridges()) {
    if (stage.seen(bridge.distance_m)) add_wall_across(stage, bridge.distance_m, 7.0, 6.2, 40.0, 7.6, 0.45F);
  }
}

}  // namespace

void draw_scenery(const Line& line, const LocalTrack& main, const Illumination& light,
                  const geometry::Intrinsics& camera, const Shot& shot, cv::Mat& radiance) {
  if (main.empty()) return;
  Stage stage(line, light, shot.distance_m);
  add_masts(line, stage);
  add_platforms(line, stage);
  add_bridges(line, stage);
  add_tunnels(line, stage);
  stage.paint_all(geometry::View(camera, shot.pose), radiance);
}

}  // namespace railfix::simulator
