#include "simulator/renderer.hpp"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

#include "core/random.hpp"
#include "simulator/air.hpp"
#include "simulator/ground_shader.hpp"
#include "simulator/illumination.hpp"
#include "simulator/ray_caster.hpp"
#include "simulator/scenery.hpp"

namespace railfix::simulator {
namespace {

constexpr size_t kNoiseCount = 1U << 16U;
constexpr float kWhite = 235.0F;  // grey level of albedo 1 at gain 1

constexpr int kUndrawnGrey = 90;
// Where and when a rail counts as visible.
constexpr double kSeenFromM = 3.0;
constexpr double kSeenToM = 25.0;
constexpr double kSeenStepM = 0.5;
constexpr double kHeadAlbedo = 0.75;
constexpr double kBesideAlbedo = 0.35;
constexpr double kLeastContrastGrey = 6.0;
constexpr double kNoises = 2.0;
constexpr float kClearEnough = 0.35F;
constexpr double kStripBeginM = 0.5;
constexpr double kStripStepM = 0.5;

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

// Widens the spans of the rows between two pixels so that both of them and the line between them lie inside.
void widen(const Eigen::Vector2d& a, const Eigen::Vector2d& b, int width, std::vector<Renderer::Columns>& spans) {
  const double rows = static_cast<double>(spans.size());
  const int first = static_cast<int>(std::clamp(std::floor(std::min(a.y(), b.y())), 0.0, rows));
  const int last = static_cast<int>(std::clamp(std::ceil(std::max(a.y(), b.y())), -1.0, rows - 1.0));
  for (int v = first; v <= last; ++v) {
    const double w = std::abs(b.y() - a.y()) < 1e-6 ? 0.0 : std::clamp((v - a.y()) / (b.y() - a.y()), 0.0, 1.0);
    const double u = std::clamp(a.x() + w * (b.x() - a.x()), -1.0, static_cast<double>(width));
    auto& span = spans[static_cast<size_t>(v)];
    span.begin = std::clamp(static_cast<int>(u) - 1, 0, span.begin);
    span.end = std::clamp(static_cast<int>(u) + 2, span.end, width);
  }
}

}  // namespace

Renderer::Renderer(std::shared_ptr<const Line> line, const RenderOptions& options)
    : line_(std::move(line)),
      options_(options),
      shadows_(options.weather.shadows, mix_bits(options.seed, 105)),
      windscreen_(options.weather.glass, {options.camera.width_px, options.camera.height_px},
                  mix_bits(options.seed, 106)),
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
  Illumination light(*line_, shot.look.light, shot.distance_m);
  light.cast(shadows_.slice(shot.distance_m, shot.look.time_s), shot.look.shadows);
  const RayCaster caster({options_.camera, shot, foot.pose.heading_rad}, {main, branches, shader, light});
  const auto spans = drawn_spans(main, shot);
  // Kept from picture to picture: the system takes longer to give memory than we to fill it.
  thread_local cv::Mat radiance;
  radiance.create(options_.camera.height_px, options_.camera.width_px, CV_32FC1);
  // Drops and dirt spread what is behind them.
  const bool all = draws_all(shot.distance_m);
  if (!all && shot.look.drops + shot.look.dirt > 0.0) radiance.setTo(kUndrawnGrey / kWhite);
  for (int v = 0; v < radiance.rows; ++v) {
    const auto span = spans[static_cast<size_t>(v)];
    const size_t first = static_cast<size_t>(v) * static_cast<size_t>(radiance.cols) + static_cast<size_t>(span.begin);
    if (span.end > span.begin)
      caster.row(&normal_x_[first], &normal_y_[first], span.end - span.begin, radiance.ptr<float>(v) + span.begin);
  }
  if (options_.scenery && all) draw_scenery(*line_, main, light, options_, shot, radiance);
  weather(shot, foot.pose.heading_rad, light, radiance);
  return expose(radiance, spans, shot);
}

InTheAir Renderer::air(const Shot& shot, double heading_rad) const {
  return {options_.camera, shot.pose, shot.distance_m, shot.speed_mps, shot.exposure_s, heading_rad, options_.seed};
}

void Renderer::weather(const Shot& shot, double heading_rad, const Illumination& light, cv::Mat& radiance) const {
  const auto here = air(shot, heading_rad);
  if (shot.look.leaves > 0.0) draw_leaves(here, shot.look, light, radiance);
  if (shot.look.rain > 0.0) draw_rain(here, shot.look, light, radiance);
  windscreen_.apply(shot.look, radiance);
  Glare(here, light).apply(radiance);
}

double Renderer::rails_visible(const Shot& shot) const {
  const auto foot = line_->path().at(shot.distance_m);
  const LocalTrack main(line_->main(), shot.distance_m, foot);
  const Illumination light(*line_, shot.look.light, shot.distance_m);
  const Glare glare(air(shot, foot.pose.heading_rad), light);
  const geometry::View view(options_.camera, shot.pose);
  std::vector<Eigen::Vector2d> pixels;
  std::vector<float> levels;
  for (double x = kSeenFromM; x <= kSeenToM; x += kSeenStepM) {
    const auto at = static_cast<float>(x);
    if (!main.covers(at)) break;
    const double middle = -static_cast<double>(main.locate(at, 0.0F).d_m);
    for (const double side : {1.0, -1.0}) {
      const double y = middle + side * static_cast<double>(kHalfGaugeM);
      const auto pixel = view.project({x, y, static_cast<double>(main.height(at, static_cast<float>(y)).z_m)});
      if (!pixel || pixel->x() < 0 || pixel->y() < 0 || pixel->x() > options_.camera.width_px - 1 ||
          pixel->y() > options_.camera.height_px - 1)
        continue;
      pixels.push_back(*pixel);
      // Where shadows move the rail is judged in the shadow.
      const auto level = light.on_ground(at, at, static_cast<float>(y));
      levels.push_back(level.diffuse + level.direct * (1.0F - static_cast<float>(shot.look.shadows)));
    }
  }
  const auto clear = windscreen_.clear(shot.look, pixels);
  const double scale = static_cast<double>(kWhite) * shot.gain;
  const double amplified = std::max(1.0, shot.gain);
  int seen = 0;
  for (size_t i = 0; i < pixels.size(); ++i) {
    const double light_here = static_cast<double>(clear[i] * levels[i]);
    const double veil = static_cast<double>(glare.at(pixels[i].x(), pixels[i].y()));
    const double head = std::min(255.0, scale * (kHeadAlbedo * light_here + veil));
    const double beside = std::min(255.0, scale * (kBesideAlbedo * light_here + veil));
    const double noise = amplified * std::sqrt(options_.read_noise_grey * options_.read_noise_grey +
                                               options_.shot_noise_grey * head / amplified);
    seen += clear[i] > kClearEnough && head - beside > std::max(kLeastContrastGrey, kNoises * noise);
  }
  return pixels.empty() ? 0.0 : static_cast<double>(seen) / static_cast<double>(pixels.size());
}

bool Renderer::draws_all(double distance_m) const {
  const double before_m = options_.strip.whole_before_m;
  if (options_.strip.ahead_m <= 0.0) return true;
  if (before_m <= 0.0) return false;
  const auto in_front = [&](double begin_m, double end_m) {
    return distance_m > begin_m - before_m && distance_m < end_m;
  };
  const auto& things = line_->things();
  const auto& tunnels = line_->tunnels();
  return std::any_of(tunnels.begin(), tunnels.end(), [&](const Span& t) { return in_front(t.begin_m, t.end_m); }) ||
         std::any_of(things.begin(), things.end(), [&](const Thing& t) {
           return t.own && t.kind == track::LandmarkKind::frog && in_front(t.distance_m, t.distance_m);
         });
}

std::vector<Renderer::Columns> Renderer::drawn_spans(const LocalTrack& main, const Shot& shot) const {
  const auto& strip = options_.strip;
  const int width = options_.camera.width_px;
  std::vector<Columns> spans(static_cast<size_t>(options_.camera.height_px), {0, width});
  if (draws_all(shot.distance_m) || main.empty()) return spans;
  for (auto& span : spans) span = {width, 0};
  const geometry::View view(options_.camera, shot.pose);
  for (const double side : {-1.0, 1.0}) {
    std::optional<Eigen::Vector2d> before;
    for (double x = kStripBeginM; x <= strip.ahead_m; x += kStripStepM) {
      const auto at = static_cast<float>(x);
      const auto place = main.locate(at, 0.0F);
      const double y = side * strip.beside_m / static_cast<double>(place.cos_heading) - static_cast<double>(place.d_m);
      const auto pixel = view.project({x, y, static_cast<double>(main.height(at, static_cast<float>(y)).z_m)});
      if (before && pixel) widen(*before, *pixel, width, spans);
      before = pixel;
    }
  }
  return spans;
}

cv::Mat Renderer::expose(const cv::Mat& radiance, const std::vector<Columns>& spans, const Shot& shot) const {
  cv::Mat picture(radiance.size(), CV_8UC1, cv::Scalar(kUndrawnGrey));
  // What amplifies the light amplifies its noise.
  const double amplified = std::max(1.0, shot.gain);
  const double read_noise = options_.read_noise_grey * amplified;
  const Film film{kWhite * static_cast<float>(shot.gain), static_cast<float>(read_noise * read_noise),
                  static_cast<float>(options_.shot_noise_grey * amplified)};
  for (int v = 0; v < radiance.rows; ++v) {
    const auto span = spans[static_cast<size_t>(v)];
    const size_t first = static_cast<size_t>(v) * static_cast<size_t>(radiance.cols) + static_cast<size_t>(span.begin);
    const float* noise = &noise_[mix_bits(shot.noise_seed, v, 5) % kNoiseCount];
    if (span.end > span.begin)
      expose_row(radiance.ptr<float>(v) + span.begin, &vignette_[first], noise, film, span.end - span.begin,
                 picture.ptr<uint8_t>(v) + span.begin);
  }
  return picture;
}

}  // namespace railfix::simulator
