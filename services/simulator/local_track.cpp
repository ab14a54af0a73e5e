#include "simulator/local_track.hpp"

namespace railfix::simulator {
namespace {

constexpr double kBehindFootM = 40.0;
constexpr double kSightM = 270.0;
constexpr double kSideM = 60.0;
constexpr double kFlatM = 1e-5;

// The sample near the foot: from where the line's own scale says, downhill in steps of 10 m (a track beside the path
// is longer or shorter than it).
size_t near_foot(const CentreLine& line, double s_origin_m, const track::TrackPoint& foot) {
  const auto gap = [&](int64_t i) {
    const auto& pose = line.samples[static_cast<size_t>(i)].pose;
    return std::hypot(pose.easting_m - foot.pose.easting_m, pose.northing_m - foot.pose.northing_m);
  };
  const auto last = static_cast<int64_t>(line.samples.size()) - 1;
  const double guess = (s_origin_m - line.begin_m) / kCentreStepM;
  int64_t near = std::clamp(static_cast<int64_t>(guess), int64_t{0}, last);
  for (const int64_t step : {-40, 40}) {
    while (near + step >= 0 && near + step <= last && gap(near + step) < gap(near)) near += step;
  }
  return static_cast<size_t>(near);
}

}  // namespace

struct LocalTrack::Seen {
  double x, y, s, turn, curvature, z, twist;
};

LocalTrack::LocalTrack(const CentreLine& line, double s_origin_m, const track::TrackPoint& foot) : lane_(line.edge) {
  const double sin_h = std::sin(foot.pose.heading_rad);
  const double cos_h = std::cos(foot.pose.heading_rad);
  const auto behind = static_cast<size_t>(kBehindFootM / kCentreStepM);
  const size_t near = near_foot(line, s_origin_m, foot);
  const size_t first = near > behind ? near - behind : 0;
  std::vector<Seen> seen;
  for (size_t i = first; i < line.samples.size(); ++i) {
    const auto& sample = line.samples[i];
    const double de = sample.pose.easting_m - foot.pose.easting_m;
    const double dn = sample.pose.northing_m - foot.pose.northing_m;
    const double x = de * sin_h + dn * cos_h;
    const double y = -de * cos_h + dn * sin_h;
    if (x < -10.0 || x > kSightM || std::abs(y) > kSideM + x) {
      if (!seen.empty()) break;
      continue;
    }
    const double turn = foot.pose.heading_rad - sample.pose.heading_rad;
    if (!seen.empty() && x <= seen.back().x) break;
    const double z = sample.elevation_m - foot.elevation_m - foot.grade * x;
    // Only the change of cant against the foot matters: the track axes lie in the canted plane.
    const double twist = -(sample.cant_m - foot.cant_m) / kRailSpacingM;
    const double s = line.begin_m + static_cast<double>(i) * kCentreStepM - s_origin_m;
    seen.push_back({x, y, s, turn, sample.curvature_per_m, z, twist});
  }
  if (seen.size() > 8) tabulate(seen);
}

void LocalTrack::tabulate(const std::vector<Seen>& seen) {
  const auto grid = [](double x) { return (x - static_cast<double>(kBehindM)) / static_cast<double>(kStepM); };
  first_ = std::max(0, static_cast<int>(std::ceil(grid(seen.front().x))));
  const int last = static_cast<int>(std::floor(std::min(grid(seen.back().x), grid(static_cast<double>(kAheadM)))));
  size_t j = 0;
  for (int i = first_; i <= last; ++i) {
    const double x = static_cast<double>(kBehindM) + i * static_cast<double>(kStepM);
    while (j + 2 < seen.size() && seen[j + 1].x < x) ++j;
    const Seen& a = seen[j];
    const Seen& b = seen[j + 1];
    const double w = (x - a.x) / (b.x - a.x);
    const double turn = a.turn + w * std::remainder(b.turn - a.turn, 6.283185307179586);
    const auto mix = [w](double from, double to) { return static_cast<float>(from + w * (to - from)); };
    const float z = mix(a.z, b.z);
    const float twist = mix(a.twist, b.twist);
    lowest_m_ = std::min(lowest_m_, z - kCantedM * std::abs(twist));
    highest_m_ = std::max(highest_m_, z + kCantedM * std::abs(twist));
    flat_ = flat_ && std::abs(z) < kFlatM && std::abs(twist) < kFlatM;
    rows_.push_back({mix(a.y, b.y), mix(a.s, b.s), static_cast<float>(std::cos(turn)),
                     static_cast<float>(std::sin(turn)), mix(a.curvature, b.curvature), z, twist, 0.0F});
  }
  if (rows_.size() < 2) {
    rows_.clear();
    return;
  }
  begin_m_ = kBehindM + static_cast<float>(first_) * kStepM;
  end_m_ = begin_m_ + static_cast<float>(rows_.size() - 1) * kStepM;
}

float LocalTrack::steepest(float height_m) const {
  float steepest = -1e-4F;
  for (size_t i = 0; i < rows_.size(); ++i) {
    const float x = begin_m_ + static_cast<float>(i) * kStepM;
    if (x > 1.0F) steepest = std::max(steepest, (rows_[i].z + kCantedM * std::abs(rows_[i].twist) - height_m) / x);
  }
  return steepest;
}

}  // namespace railfix::simulator
