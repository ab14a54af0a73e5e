// From pixels to places on the track's surface, and what the tracks there show.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "simulator/ground_shader.hpp"
#include "simulator/illumination.hpp"
#include "simulator/local_track.hpp"

namespace railfix::simulator {

class RayCaster {
 public:
  struct Eye {
    const geometry::Intrinsics& camera;
    const Shot& shot;
    double heading_rad;  // of the track at the foot, for the hills on the horizon and the sun
  };
  struct Ground {
    const LocalTrack& main;
    const std::vector<LocalTrack>& branches;
    const GroundShader& shader;
    const Illumination& light;
  };
  RayCaster(const Eye& eye, const Ground& ground);

  /// A row of the picture or a part of it, albedo times light. normal_x, normal_y: the pixels' undistorted x/z and y/z.
  void row(const float* normal_x, const float* normal_y, int count, float* out) const;

 private:
  struct Hit {
    float x, y, scale;  // place and ray length, ray = direction * scale
  };
  static constexpr size_t kMostBranches = 4;
  /// A pixel with everything that its albedo depends on. Where two neighbours in a row are alike, so is all between.
  struct Sample {
    Eigen::Vector3f ray;
    Hit hit{};
    bool ground = false;  // else sky
    bool track = false;   // near enough for `own` and `others`
    GroundPixel own;
    Illumination::Level light{};
    size_t other_count = 0;
    GroundPixel others[kMostBranches];
    size_t branch[kMostBranches];  // whose pixel that is
  };
  [[nodiscard]] Sample sample(float normal_x, float normal_y) const;
  [[nodiscard]] bool alike(const Sample& a, const Sample& b) const;
  static void between(const Sample& a, const Sample& b, float w, Sample& out);
  [[nodiscard]] float albedo(const Sample& sample) const;
  [[nodiscard]] bool meet(const Eigen::Vector3f& ray, Hit& hit) const;
  [[nodiscard]] bool march(const Eigen::Vector3f& ray, Hit& hit) const;
  [[nodiscard]] float sky(const Eigen::Vector3f& ray) const;
  [[nodiscard]] float beside_head(const GroundPixel& pixel) const;
  [[nodiscard]] float head(const GroundPixel& pixel, const Sample& sample) const;
  [[nodiscard]] float wetted(float albedo, const Eigen::Vector3f& ray) const;
  [[nodiscard]] float junction(const Sample& sample) const;
  [[nodiscard]] GroundPixel pixel_on(const LocalTrack& track, const Eigen::Vector3f& ray, const Hit& hit) const;

  const LocalTrack& main_;
  const std::vector<LocalTrack>& branches_;
  const GroundShader& shader_;
  const Illumination& light_;
  Eigen::Matrix3f track_from_camera_;
  Eigen::Vector3f step_u_;  // change of the ray per pixel
  Eigen::Vector3f step_v_;
  float height_m_;
  float lateral_m_;
  float blur_m_;
  float heading_rad_;
  float wet_;
  float sun_ahead_;  // of the direction to the sun, its part along the track
  float steepest_;   // rays above it meet the sky
};

}  // namespace railfix::simulator
