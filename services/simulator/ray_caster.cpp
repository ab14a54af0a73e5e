#include "simulator/ray_caster.hpp"

#include <cmath>

namespace railfix::simulator {
namespace {

constexpr float kHaze = 0.62F;
constexpr float kHazeDistanceM = 500.0F;
constexpr float kHills = 0.50F;
constexpr float kHighestHill = 0.068F;  // rise per metre
constexpr float kFarGround = 0.42F;
constexpr float kNearM = 40.0F;  // up to here Newton's method finds the surface
constexpr float kMarchM = 4.0F;
constexpr float kFlangewayM = 0.045F;
constexpr float kBladesEndM = 0.4F;  // further apart than this the tracks' rails are whole but for the frog
constexpr float kHalfSleeperM = 1.3F;
constexpr float kOwnSleepersM = 2.2F;  // so far apart each track has its own sleepers
constexpr float kBranchSideM = 3.0F;
constexpr float kTunnelHalfWidthM = 2.8F;
constexpr size_t kMostBranches = 4;

float hazy(float albedo, float distance_m) {
  return albedo + (kHaze - albedo) * std::min(1.0F, distance_m / kHazeDistanceM);
}

// The inside of a rail where wheel flanges of that track run.
float flangeway(const GroundPixel& pixel) {
  const float d = std::abs(pixel.at.d_m);
  const float size = pixel.edge_d_m;
  const float a = std::max(kHalfGaugeM - kFlangewayM, d - 0.5F * size);
  const float b = std::min(kHalfGaugeM, d + 0.5F * size);
  return b > a ? (b - a) / size : 0.0F;
}

}  // namespace

RayCaster::RayCaster(const Eye& eye, const LocalTrack& main, const std::vector<LocalTrack>& branches,
                     const GroundShader& shader)
    : main_(main),
      branches_(branches),
      shader_(shader),
      track_from_camera_(geometry::rotation_camera_from_track(eye.shot.pose).transpose().cast<float>()),
      step_u_(track_from_camera_.col(0) / static_cast<float>(eye.camera.fu_px)),
      step_v_(track_from_camera_.col(1) / static_cast<float>(eye.camera.fv_px)),
      height_m_(static_cast<float>(eye.shot.pose.height_m)),
      lateral_m_(static_cast<float>(eye.shot.pose.lateral_m)),
      blur_m_(static_cast<float>(std::abs(eye.shot.speed_mps) * eye.shot.exposure_s)),
      heading_rad_(static_cast<float>(eye.heading_rad)),
      steepest_(main.steepest(height_m_)) {}

void RayCaster::row(const float* normal_x, const float* normal_y, int count, float* out) const {
  for (int u = 0; u < count; ++u) {
    const Eigen::Vector3f ray =
        track_from_camera_.col(0) * normal_x[u] + track_from_camera_.col(1) * normal_y[u] + track_from_camera_.col(2);
    Hit hit{};
    out[u] = meet(ray, hit) ? surface(ray, hit) : sky(ray);
  }
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
  const auto over = [&](float x) { return height_m_ - fall * x - main_.centre_z(x); };
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
  const float dome = 0.98F - 0.35F * std::min(rise, 0.6F);
  if (rise > kHighestHill) return dome;
  const float azimuth = std::atan2(ray.y(), ray.x()) - heading_rad_;
  const float hills = 0.035F + 0.018F * std::sin(azimuth * 7.0F) + 0.009F * std::sin(azimuth * 17.0F + 1.0F) +
                      0.004F * std::sin(azimuth * 53.0F);
  const float w = std::clamp((rise - hills) * 600.0F, 0.0F, 1.0F);
  return kHills + w * (dome - kHills);
}

GroundPixel RayCaster::pixel_on(const LocalTrack& track, const Eigen::Vector3f& ray, const Hit& hit) const {
  GroundPixel pixel;
  pixel.at = track.locate(hit.x, hit.y);
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

float RayCaster::surface(const Eigen::Vector3f& ray, const Hit& hit) const {
  if (!main_.covers(hit.x) || ray.z() > -1e-4F) return hazy(kFarGround, hit.x);
  const GroundPixel own = pixel_on(main_, ray, hit);
  float albedo = 0.0F;
  if (branches_.empty()) {
    albedo = GroundShader::foot_and_web(own, shader_.ground(own, kHalfSleeperM));
    const float share = GroundShader::head_cover(own);
    if (share > 0.0F) albedo += share * (shader_.head(own) - albedo);
  } else {
    albedo = junction(own, ray, hit);
  }
  if (std::abs(own.at.d_m) < kTunnelHalfWidthM) albedo *= shader_.light(own.at.s_m);
  return hazy(albedo, hit.x);
}

// Several tracks: the ground of the nearest, the rails of all. Wheels need their groove where rails come together:
// blades stand off from the rail beside them, frogs have gaps.
float RayCaster::junction(const GroundPixel& own, const Eigen::Vector3f& ray, const Hit& hit) const {
  struct Other {
    GroundPixel pixel;
    float apart_m;
  };
  Other others[kMostBranches];
  size_t count = 0;
  GroundPixel nearest = own;
  float half_length_m = kHalfSleeperM;
  for (const auto& branch : branches_) {
    if (count == kMostBranches || !branch.covers(hit.x)) continue;
    const GroundPixel pixel = pixel_on(branch, ray, hit);
    if (std::abs(pixel.at.d_m) > kBranchSideM) continue;
    const float apart_m = std::abs(own.at.d_m - pixel.at.d_m);
    others[count++] = {pixel, apart_m};
    if (apart_m < kOwnSleepersM) {
      half_length_m = std::max(half_length_m, kHalfSleeperM + apart_m);
    } else if (std::abs(pixel.at.d_m) < std::abs(nearest.at.d_m)) {
      nearest = pixel;
    }
  }
  float albedo = GroundShader::foot_and_web(own, shader_.ground(nearest, half_length_m));
  for (size_t i = 0; i < count; ++i) albedo = GroundShader::foot_and_web(others[i].pixel, albedo);
  float own_share = GroundShader::head_cover(own);
  for (size_t i = 0; i < count; ++i) {
    const float share = GroundShader::head_cover(others[i].pixel) * (1.0F - flangeway(own));
    if (share > 0.0F) albedo += share * (shader_.head(others[i].pixel) - albedo);
    if (others[i].apart_m > kBladesEndM) own_share *= 1.0F - flangeway(others[i].pixel);
  }
  if (own_share > 0.0F) albedo += own_share * (shader_.head(own) - albedo);
  return albedo;
}

}  // namespace railfix::simulator
