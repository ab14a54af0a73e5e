#include "simulator/renderer.hpp"

#include <cmath>
#include <opencv2/imgproc.hpp>

#include "core/random.hpp"
#include "simulator/ground_shader.hpp"
#include "simulator/ray_caster.hpp"
#include "simulator/scenery.hpp"

namespace railfix::simulator {
namespace {

constexpr size_t kNoiseCount = 1U << 16U;
constexpr float kWhite = 235.0F;  // grey level of albedo 1 at gain 1

struct Film {
  float scale;          // grey levels of radiance 1
  float read_variance;  // grey levels squared, in the dark
  float shot_variance;  // more of it per grey level
};

void expose_row(const float* in, const float* vignette, const float* noise, const Film& film, int count, uint8_t* out) {
  for (int u = 0; u < count; ++u) {
    const float clean = std::min(in[u] * vignette[u] * film.scale, 255.0F);
    const float noisy = clean + std::sqrt(film.read_variance + film.shot_variance * clean) * noise[u];
    out[u] = static_cast<uint8_t>(std::clamp(noisy + 0.5F, 0.0F, 255.0F));
  }
}

}  // namespace

Renderer::Renderer(std::shared_ptr<const Line> line, const RenderOptions& options)
    : line_(std::move(line)),
      options_(options),
      ballast_(ballast_tile(mix_bits(options.seed, 101), 0.045F)),
      concrete_(concrete_tile(mix_bits(options.seed, 102))),
      verge_(verge_tile(mix_bits(options.seed, 103))) {
  const auto& camera = options_.camera;
  const size_t count = static_cast<size_t>(camera.width_px) * static_cast<size_t>(camera.height_px);
  normal_x_.reserve(count);
  normal_y_.reserve(count);
  vignette_.reserve(count);
  const double corner2 = camera.cu_px * camera.cu_px + camera.cv_px * camera.cv_px;
  for (int v = 0; v < camera.height_px; ++v) {
    for (int u = 0; u < camera.width_px; ++u) {
      const auto normal = geometry::undistort(camera, {u, v});
      normal_x_.push_back(static_cast<float>(normal.x()));
      normal_y_.push_back(static_cast<float>(normal.y()));
      const double r2 = (u - camera.cu_px) * (u - camera.cu_px) + (v - camera.cv_px) * (v - camera.cv_px);
      vignette_.push_back(static_cast<float>(1.0 - options_.vignetting * r2 / corner2));
    }
  }
  core::Random random(mix_bits(options.seed, 104));
  // A row takes its noise in one piece from anywhere in the first kNoiseCount.
  noise_.resize(kNoiseCount + static_cast<size_t>(camera.width_px));
  for (auto& value : noise_) value = static_cast<float>(random.normal());
}

cv::Mat Renderer::render(const Shot& shot) const {
  const auto foot = line_->path().at(shot.distance_m);
  const LocalTrack main(line_->main(), shot.distance_m, foot);
  std::vector<LocalTrack> branches;
  for (const auto& branch : line_->branches()) {
    LocalTrack seen(branch, shot.distance_m, foot);
    if (!seen.empty()) branches.push_back(std::move(seen));
  }
  const GroundShader shader(*line_, options_, {ballast_, concrete_, verge_}, shot.distance_m);
  const RayCaster caster({options_.camera, shot, foot.pose.heading_rad}, main, branches, shader);
  cv::Mat radiance(options_.camera.height_px, options_.camera.width_px, CV_32FC1);
  for (int v = 0; v < radiance.rows; ++v) {
    const size_t first = static_cast<size_t>(v) * static_cast<size_t>(radiance.cols);
    caster.row(&normal_x_[first], &normal_y_[first], radiance.cols, radiance.ptr<float>(v));
  }
  if (options_.scenery) draw_scenery(*line_, main, shader, options_.camera, shot, radiance);
  return expose(radiance, shot);
}

cv::Mat Renderer::expose(const cv::Mat& radiance, const Shot& shot) const {
  cv::Mat picture(radiance.size(), CV_8UC1);
  const Film film{kWhite * static_cast<float>(shot.gain),
                  static_cast<float>(options_.read_noise_grey * options_.read_noise_grey),
                  static_cast<float>(options_.shot_noise_grey)};
  for (int v = 0; v < radiance.rows; ++v) {
    const size_t first = static_cast<size_t>(v) * static_cast<size_t>(radiance.cols);
    const float* noise = &noise_[mix_bits(shot.noise_seed, v, 5) % kNoiseCount];
    expose_row(radiance.ptr<float>(v), &vignette_[first], noise, film, radiance.cols, picture.ptr<uint8_t>(v));
  }
  return picture;
}

}  // namespace railfix::simulator
