#include "simulator/ray_caster.hpp"

#include <cmath>
#include <span>

#include "simulator/switches.hpp"

namespace railfix::simulator {
namespace {

constexpr float kHills = 0.50F;
constexpr float kHighestHill = 0.068F;  // rise per metre
constexpr float kFarGround = 0.42F;
constexpr float kNearM = 40.0F;  // up to here Newton's method finds the surface
constexpr float kMarchM = 4.0F;
constexpr float kFrogPlate = 0.17F;
constexpr float kCheckRail = 0.34F;
constexpr float kOwnSleepersM = 2.2F;  // so far apart each track has its own sleepers
constexpr float kBranchSideM = 3.0F;
constexpr float kNowhereM = -1e6F;
constexpr float kBrushed = 0.12F;
constexpr float kGlint = 1.6F;
constexpr float kWetDarker = 0.48F;
constexpr float kWetFilm = 0.30F;
constexpr int kBlockPx = 8;  // so far apart rays are cast; between them the ground is smooth
constexpr float kSmooth = 0.06F;
constexpr float kHorizonRise = -1e-4F;

}  // namespace

RayCaster::RayCaster(const Eye& eye, const Ground& ground)
    : main_(ground.main),
      branches_(ground.branches),
      shader_(ground.shader),
      light_(ground.light),
      track_from_camera_(geometry::rotation_camera_from_track(eye.shot.pose).transpose().cast<float>()),
      step_u_(track_from_camera_.col(0) / static_cast<float>(eye.camera.fu_px)),
      step_v_(track_from_camera_.col(1) / static_cast<float>(eye.camera.fv_px)),
      height_m_(static_cast<float>(eye.shot.pose.height_m)),
      lateral_m_(static_cast<float>(eye.shot.pose.lateral_m)),
      blur_m_(static_cast<float>(std::abs(eye.shot.speed_mps) * eye.shot.exposure_s)),
      heading_rad_(static_cast<float>(eye.heading_rad)),
      wet_(static_cast<float>(eye.shot.look.wet)),
      sun_ahead_(static_cast<float>(std::cos(ground.light.open().sun_elevation_rad) *
                                    std::cos(eye.heading_rad - ground.light.open().sun_heading_rad))),
      steepest_(ground.main.steepest(height_m_)) {}

void RayCaster::row(const float* normal_x, const float* normal_y, int count, float* out) const {
  Sample first = sample(normal_x[0], normal_y[0]);
  Sample mixed = first;
  for (int begin = 0; begin < count; begin += kBlockPx) {
    const int end = std::min(begin + kBlockPx, count - 1);
    const Sample last = sample(normal_x[end], normal_y[end]);
    const int stop = std::min(begin + kBlockPx, count);
    if (alike(first, last)) {
      mixed.ground = first.ground;
      mixed.track = first.track;
      mixed.light = first.light;
      mixed.other_count = first.other_count;
      const float step = 1.0F / static_cast<float>(std::max(1, end - begin));
      for (int u = begin; u < stop; ++u) {
        between(first, last, static_cast<float>(u - begin) * step, mixed);
        out[u] = albedo(mixed);
      }
    } else {
      for (int u = begin; u < stop; ++u) out[u] = albedo(sample(normal_x[u], normal_y[u]));
    }
    first = last;
  }
}

RayCaster::Sample RayCaster::sample(float normal_x, float normal_y) const {
  Sample here;
  here.ray = track_from_camera_.col(0) * normal_x + track_from_camera_.col(1) * normal_y + track_from_camera_.col(2);
  here.ground = meet(here.ray, here.hit);
  here.track = here.ground && main_.covers(here.hit.x) && here.ray.z() <= kHorizonRise;
  const auto& open = light_.open();
  here.light = {static_cast<float>(open.sky), static_cast<float>(open.sun)};
  if (!here.track) return here;
  here.own = pixel_on(main_, here.ray, here.hit);
  for (size_t i = 0; i < branches_.size() && here.other_count < kMostBranches; ++i) {
    if (!branches_[i].covers(here.hit.x)) continue;
    here.branch[here.other_count] = i;
    here.others[here.other_count++] = pixel_on(branches_[i], here.ray, here.hit);
  }
  if (!light_.uniform()) {
    const float beside = std::abs(here.own.at.d_m);
    // Beside a tunnel lies its hill, which nobody sees from inside.
    const float s = beside < light_.tunnel_reach_m() ? here.own.at.s_m : kNowhereM;
    here.light = light_.on_ground(s, here.hit.x, here.hit.y);
  }
  return here;
}

bool RayCaster::alike(const Sample& a, const Sample& b) const {
  if (a.ground != b.ground || a.track != b.track) return false;
  if (!a.ground) return a.ray.z() > kHighestHill * a.ray.x() && b.ray.z() > kHighestHill * b.ray.x();
  if (std::abs(a.hit.x - b.hit.x) > kSmooth * a.hit.x) return false;
  return a.other_count == b.other_count && std::equal(a.branch, a.branch + a.other_count, b.branch);
}

void RayCaster::between(const Sample& a, const Sample& b, float w, Sample& out) {
  const auto mix = [w](float from, float to) { return from + w * (to - from); };
  const auto mix_pixels = [&](const GroundPixel& from, const GroundPixel& to, GroundPixel& at) {
    at.at = {mix(from.at.s_m, to.at.s_m), mix(from.at.d_m, to.at.d_m), mix(from.at.cos_heading, to.at.cos_heading),
             mix(from.at.sin_heading, to.at.sin_heading), mix(from.at.stretch, to.at.stretch)};
    at.lane = from.lane;
    at.slope_s = mix(from.slope_s, to.slope_s);
    at.slope_d = mix(from.slope_d, to.slope_d);
    at.size_s_m = mix(from.size_s_m, to.size_s_m);
    at.size_d_m = mix(from.size_d_m, to.size_d_m);
    at.edge_d_m = mix(from.edge_d_m, to.edge_d_m);
  };
  out.ray = a.ray + w * (b.ray - a.ray);
  if (!a.ground) return;
  out.hit.x = mix(a.hit.x, b.hit.x);
  if (!a.track) return;
  out.light = {mix(a.light.diffuse, b.light.diffuse), mix(a.light.direct, b.light.direct)};
  mix_pixels(a.own, b.own, out.own);
  for (size_t i = 0; i < a.other_count; ++i) mix_pixels(a.others[i], b.others[i], out.others[i]);
}

bool RayCaster::meet(const Eigen::Vector3f& ray, Hit& hit) const {
  if (ray.x() <= 0.0F || ray.z() > steepest_ * ray.x()) return false;
  hit.scale = -height_m_ / std::min(ray.z(), -1e-6F);
  hit.x = hit.scale * ray.x();
  hit.y = lateral_m_ + hit.scale * ray.y();
  if (main_.flat()) return true;
  if (hit.x > kNearM) return march(ray, hit);
  for (int i = 0; i < 2; ++i) {
    // Newton on height + scale * ray.z = z(x).
    const auto there = main_.height(hit.x, hit.y);
    hit.scale -= (height_m_ + hit.scale * ray.z() - there.z_m) / (ray.z() - there.slope * ray.x());
    hit.x = hit.scale * ray.x();
    hit.y = lateral_m_ + hit.scale * ray.y();
  }
  return true;
}

// Near the horizon humps and hollows decide where a ray lands: walk between the heights that the surface can have.
bool RayCaster::march(const Eigen::Vector3f& ray, Hit& hit) const {
  const float fall = -ray.z() / ray.x();
  const float aside = ray.y() / ray.x();
  const auto over = [&](float x) { return height_m_ - fall * x - main_.height(x, lateral_m_ + x * aside).z_m; };
  const float first = fall > 1e-5F ? std::max(kNearM - 10.0F, (height_m_ - main_.highest_m()) / fall) : kNearM - 10.0F;
  const float last = fall > 1e-5F ? (height_m_ - main_.lowest_m()) / fall : LocalTrack::kAheadM;
  float low = first;
  float low_over = over(low);
  for (float high = first; low < std::min(last, LocalTrack::kAheadM); low = high) {
    high = low + kMarchM;
    float high_over = over(high);
    if (high_over > 0.0F) {
      low_over = high_over;
      continue;
    }
    float x = high;
    for (int i = 0; i < 3 && low_over > high_over; ++i) {
      x = low + (high - low) * low_over / (low_over - high_over);
      const float x_over = over(x);
      (x_over > 0.0F ? low : high) = x;
      (x_over > 0.0F ? low_over : high_over) = x_over;
    }
    hit.x = x;
    hit.scale = x / ray.x();
    hit.y = lateral_m_ + hit.scale * ray.y();
    return true;
  }
  return fall > 1e-4F;  // far ground
}

float RayCaster::sky(const Eigen::Vector3f& ray) const {
  const float rise = ray.z() / ray.x();
  const auto& open = light_.open();
  const float dome = static_cast<float>(open.dome) * (0.98F - 0.35F * std::min(rise, 0.6F));
  if (rise > kHighestHill) return dome;
  const float azimuth = std::atan2(ray.y(), ray.x()) - heading_rad_;
  const float hills = 0.035F + 0.018F * std::sin(azimuth * 7.0F) + 0.009F * std::sin(azimuth * 17.0F + 1.0F) +
                      0.004F * std::sin(azimuth * 53.0F);
  const float w = std::clamp((rise - hills) * 600.0F, 0.0F, 1.0F);
  const float hill = kHills * static_cast<float>(open.sky + open.sun);
  return hill + w * (dome - hill);
}

GroundPixel RayCaster::pixel_on(const LocalTrack& track, const Eigen::Vector3f& ray, const Hit& hit) const {
  GroundPixel pixel;
  pixel.at = track.locate(hit.x, hit.y);
  pixel.lane = track.lane();
  const float c = pixel.at.cos_heading;
  const float s = pixel.at.sin_heading;
  const float sink = -1.0F / ray.z();
  const float sink_x = std::clamp(sink * ray.x(), -80.0F, 80.0F);
  const float sink_y = sink_x * ray.y() / ray.x();
  pixel.slope_s = (c * sink_x + s * sink_y) * pixel.at.stretch;
  pixel.slope_d = c * sink_y - s * sink_x;
  const auto moved = [&](const Eigen::Vector3f& step, float& along, float& across) {
    const float ratio = step.z() * -sink;
    const float x = hit.scale * (step.x() - ray.x() * ratio);
    const float y = hit.scale * (step.y() - ray.y() * ratio);
    along = c * x + s * y;
    across = c * y - s * x;
  };
  float along_u = 0.0F;
  float along_v = 0.0F;
  float across_u = 0.0F;
  float across_v = 0.0F;
  moved(step_u_, along_u, across_u);
  moved(step_v_, along_v, across_v);
  const float along = std::max(std::abs(along_u), std::abs(along_v));
  pixel.size_s_m = std::min(std::sqrt(along * along + blur_m_ * blur_m_), 30.0F);
  pixel.size_d_m = std::max(std::abs(across_u), 0.3F * std::abs(across_v));
  pixel.edge_d_m = std::sqrt(across_u * across_u + across_v * across_v);
  return pixel;
}

float RayCaster::albedo(const Sample& here) const {
  if (!here.ground) return sky(here.ray);
  if (!here.track) return (here.light.diffuse + here.light.direct) * light_.hazy(kFarGround, here.hit.x);
  const auto& at = here.own.at;
  const float sunlit =
      here.light.direct > 0.0F ? light_.sunlit(at.s_m, at.d_m, here.own.size_s_m, here.own.size_d_m) : 0.0F;
  const float light = here.light.diffuse + here.light.direct * sunlit;
  float albedo = 0.0F;
  if (here.other_count == 0) {
    const float share = GroundShader::head_cover(here.own);
    if (share < 1.0F) albedo = wetted(beside_head(here.own), here.ray);
    if (share > 0.0F) albedo += share * (head(here.own, here) - albedo);
  } else {
    albedo = junction(here);
  }
  return light * light_.hazy(albedo, here.hit.x);
}

// Web, foot and the ground beside them; the ground costs most and is left out where nothing of it shows.
float RayCaster::beside_head(const GroundPixel& pixel) const {
  const float rail = GroundShader::foot_and_web(pixel, 0.0F);
  const float ground_share = GroundShader::foot_and_web(pixel, 1.0F) - rail;
  return ground_share > 0.0F ? rail + ground_share * shader_.ground(pixel, {}) : rail;
}

// Worn steel is brushed along the track: it mirrors the sun wherever the ray and the sun make the same angle with it.
float RayCaster::head(const GroundPixel& pixel, const Sample& here) const {
  const float albedo = shader_.head(pixel);
  if (here.light.direct <= 0.0F) return albedo;
  const float along = here.ray.x() / here.ray.norm();
  const float off = (along - sun_ahead_) * (1.0F / kBrushed);
  return albedo * (1.0F + kGlint * here.light.direct / (here.light.direct + here.light.diffuse) * std::exp(-off * off));
}

// Water fills the pores, which makes things darker, and mirrors the sky under flat angles (Schlick's approximation).
float RayCaster::wetted(float albedo, const Eigen::Vector3f& ray) const {
  if (wet_ <= 0.0F) return albedo;
  const float steep = 1.0F - std::abs(ray.z()) / ray.norm();
  const float mirrored = steep * steep * steep * steep * steep;
  const auto& open = light_.open();
  const auto sky = static_cast<float>(open.dome / std::max(open.sky + open.sun, 1e-3));
  return albedo * (1.0F - kWetDarker * wet_) + wet_ * kWetFilm * mirrored * std::min(sky, 1.5F);
}

// Several tracks: the ground of the nearest, the rails of all.
float RayCaster::junction(const Sample& here) const {
  const GroundPixel* tracks[kMostBranches + 1] = {&here.own};
  size_t count = 1;
  const GroundPixel* nearest = &here.own;
  GroundShader::Reach reach;
  for (size_t i = 0; i < here.other_count; ++i) {
    const GroundPixel& pixel = here.others[i];
    if (std::abs(pixel.at.d_m) > kBranchSideM) continue;
    tracks[count++] = &pixel;
    const float apart_m = here.own.at.d_m - pixel.at.d_m;
    if (std::abs(apart_m) < kOwnSleepersM) {
      (apart_m > 0.0F ? reach.left_m : reach.right_m) += std::abs(apart_m);
    } else if (std::abs(pixel.at.d_m) < std::abs(nearest->at.d_m)) {
      nearest = &pixel;
    }
  }
  if (nearest != &here.own) reach = {};
  const std::span<const GroundPixel* const> near(tracks, count);
  float albedo = shader_.ground(*nearest, reach);
  for (size_t i = 0; i < count; ++i) {
    if (i == 0 || foot_shows(near, i)) albedo = GroundShader::foot_and_web(*tracks[i], albedo);
  }
  if (count > 1 && frog_plate(near, 0)) albedo = kFrogPlate;
  albedo = wetted(albedo, here.ray);
  for (size_t i = count; i-- > 0;) {
    const HeadShare share = count > 1 ? head_share(near, i) : HeadShare{GroundShader::head_cover(*tracks[i]), 0.0F};
    if (share.check > 0.0F) albedo += share.check * (kCheckRail - albedo);
    if (share.running > 0.0F) albedo += share.running * (head(*tracks[i], here) - albedo);
  }
  return albedo;
}

}  // namespace railfix::simulator
