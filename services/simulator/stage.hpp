// Flat faces, lines and shadows in the world beside the path, painted over the ground from far to near.
#pragma once

#include <array>
#include <opencv2/core.hpp>
#include <vector>

#include "simulator/illumination.hpp"
#include "simulator/local_track.hpp"
#include "simulator/renderer.hpp"

namespace railfix::simulator {

/// Track axes of the foot.
using Corner = Eigen::Vector3d;
using Quad = std::array<Corner, 4>;  // convex; a triangle repeats its last corner

class Stage {
 public:
  static constexpr double kFarM = 245.0;

  Stage(const Line& line, const LocalTrack& main, const Illumination& light, const RenderOptions& options,
        const Shot& shot);

  /// Point beside the path, `up_m` over its rails; upright also where the track leans.
  [[nodiscard]] Corner at(double distance_m, double lateral_m, double up_m) const {
    return beside(line_.main(), distance_m, lateral_m, up_m);
  }
  [[nodiscard]] Corner beside(const CentreLine& track, double distance_m, double lateral_m, double up_m) const;
  /// Point on the drawn ground beside the ballast, where things stand; and on the stones, where shadows fall.
  [[nodiscard]] Corner ground(double distance_m, double lateral_m) const {
    return sunk(distance_m, lateral_m, verge_depth_m_);
  }
  [[nodiscard]] Corner stones(double distance_m, double lateral_m) const {
    return sunk(distance_m, lateral_m, stone_depth_m_);
  }

  /// Offset of a point from the path, left positive.
  [[nodiscard]] double lateral_m(const Corner& corner) const {
    return static_cast<double>(main_.locate(static_cast<float>(corner.x()), static_cast<float>(corner.y())).d_m);
  }

  /// A face of its own, edges exact. Painted before all that have a smaller order_m (metres of the path). extra: light
  /// of lamps near by.
  void face(const Quad& corners, float albedo, double order_m, float extra = 0.0F) {
    add(corners, lit(corners, albedo, order_m) + albedo * extra, order_m);
  }
  /// A face that joins others: a little larger, which closes the seams, and no edge that anything is measured at.
  void panel(const Quad& corners, float albedo, double order_m, float extra = 0.0F) {
    add(corners, lit(corners, albedo, order_m) + albedo * extra, order_m, 0.9F);
  }
  /// A face that shines by itself.
  void glow(const Quad& corners, float radiance, double order_m) { add(corners, radiance, order_m); }
  void bar(const Corner& from, const Corner& to, double width_m, float albedo, double order_m);
  /// Upright post from the ground, facing the camera.
  void post(double distance_m, double lateral_m, double width_m, double top_m, float albedo);
  /// Upright rectangle across the path.
  void board(double distance_m, double lateral_m, double width_m, double bottom_m, double top_m, float albedo);
  /// Box on the ground; the faces that the camera can see.
  void box(double distance_m, double lateral_m, double length_m, double width_m, double top_m, float albedo);
  /// Darkens the ground inside, 0 = not at all, 1 = black.
  void shade(const Quad& corners, double strength);
  /// Shadow of an upright wall from one place of the path to another, in the sun.
  void cast(double from_m, double from_lateral_m, double to_m, double to_lateral_m, double bottom_m, double top_m);

  [[nodiscard]] bool seen(double distance_m) const {
    return distance_m - foot_m_ > 0.0 && distance_m - foot_m_ < kFarM;
  }
  [[nodiscard]] double foot_m() const { return foot_m_; }
  [[nodiscard]] const Line& line() const { return line_; }

  /// Steps through a span, longer ones further away: each(begin_m, end_m).
  template <class Each>
  void along(double begin_m, double end_m, double step_m, Each each) const {
    const double end = std::min(end_m, foot_m_ + kFarM);
    // Steps on a fixed grid, so that what they show stays where it is.
    for (double s = std::max(begin_m, foot_m_ - 2.0); s < end;) {
      const double wide = step_m * std::exp2(std::max(0.0, std::floor(std::log2((s - foot_m_ + 1e-9) / 30.0))));
      const double next = std::min(end, (std::floor((s - begin_m) / wide + 1e-6) + 1.0) * wide + begin_m);
      each(s, next);
      s = next;
    }
  }

  void paint(const geometry::View& view, cv::Mat& radiance);

 private:
  struct Face {
    Quad corners;
    float radiance = 0;
    float grow_px = 0.5F;
    double order_m = 0;
    double width_m = 0;  // of a bar from corner 0 to corner 1
  };
  void add(const Quad& corners, float radiance, double order_m, float grow_px = 0.5F) {
    faces_.push_back({corners, radiance, grow_px, order_m, 0.0});
  }
  void paint_shadows(const geometry::View& view, cv::Mat& radiance) const;
  [[nodiscard]] Corner sunk(double distance_m, double lateral_m, double depth_m) const;
  [[nodiscard]] float lit(const Quad& corners, float albedo, double distance_m) const;
  const Line& line_;
  const LocalTrack& main_;
  const Illumination& light_;
  double foot_m_;
  double stone_depth_m_;
  double verge_depth_m_;
  track::TrackPoint foot_;
  Eigen::Vector2d shadow_;  // metres east and north per metre of height
  double sun_;              // share of the open line's light that comes from it
  std::vector<Face> faces_;
  std::vector<Face> shadows_;  // radiance = light that remains
};

}  // namespace railfix::simulator
