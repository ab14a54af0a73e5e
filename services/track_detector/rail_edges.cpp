#include "track_detector/rail_edges.hpp"

#include <algorithm>
#include <cmath>
#include <optional>

namespace railfix::track_detector {
namespace {

constexpr double kStepPx = 0.5;        // between samples of a profile
constexpr double kEdgeSigmaPx = 0.35;  // of a clear edge
constexpr double kEdgeSigmaM = 0.003;  // wear and rounding of the head, dirt
constexpr size_t kUsualSamples = 1024;
constexpr double kSideM = 0.05;  // ground beside the head that it is compared with
// The dark web beside a head draws the steepest place towards the head, by up to this.
constexpr double kBiasPx = 0.05;
// What is too bright for the camera swallows up to half of the pixel at its edge: by how much, the darker side tells
// once the usual ratio of both is known, else nobody.
constexpr double kSwallowedPx = 0.2;
constexpr double kSwallowedSigmaPx = 0.2;
constexpr double kKnownSwallowedSigmaPx = 0.1;
constexpr double kBurntOutGrey = 245;
constexpr double kWhiteGrey = 255;
constexpr double kNearlyWhiteGrey = 210;  // single pixels of it are burnt out already
constexpr double kClearGrey = 60;         // of the brighter side; less is noise and what the camera calls black
constexpr double kNoGlint = 0.8;    // of white; a head that the ratio says is darker, and is white, mirrors the sun
constexpr int kFewestLearnt = 100;  // edges
constexpr int kRemembered = 4000;

/// Bilinear; the caller keeps it inside.
double sample(const cv::Mat& grey, double u, double v) {
  const int x = static_cast<int>(u);
  const int y = static_cast<int>(v);
  const double fx = u - x;
  const double fy = v - y;
  const auto* upper = grey.ptr<uint8_t>(y) + x;
  const auto* lower = grey.ptr<uint8_t>(y + 1) + x;
  return (1 - fy) * ((1 - fx) * upper[0] + fx * upper[1]) + fy * ((1 - fx) * lower[0] + fx * lower[1]);
}

bool inside(const cv::Mat& grey, const Eigen::Vector2d& pixel) {
  return pixel.x() >= 0 && pixel.y() >= 0 && pixel.x() < grey.cols - 1.01 && pixel.y() < grey.rows - 1.01;
}

/// Where across one rail the inner edge is, in samples, with its contrast.
struct Crossing {
  double at = 0;
  double contrast = 0;
  double brighter = 0;  // grey levels of the edge's sides
  double darker = 0;
};

/// The band that stands out most on both sides, then the steepest step at its inner side.
std::optional<Crossing> find_crossing(const EdgeProfile& profile, double head, double side, double sign,
                                      double min_contrast) {
  const int head_n = std::max(2, static_cast<int>(std::lround(head)));
  const int crown_n = std::max(2, static_cast<int>(std::lround(0.6 * head)));
  const int side_n = std::max(2, static_cast<int>(std::lround(side)));
  int best = -1;
  double best_contrast = min_contrast;
  for (int i = side_n; i + head_n + side_n <= profile.size(); ++i) {
    const double crown = profile.mean(i, i + crown_n);
    const double contrast = std::min(sign * (crown - profile.mean(i - side_n, i)),
                                     sign * (crown - profile.mean(i + head_n, i + head_n + side_n)));
    if (contrast > best_contrast) {
      best_contrast = contrast;
      best = i;
    }
  }
  if (best < 0) return std::nullopt;
  // Step between the few samples on either side, sub-sample by a parabola through its peak.
  const int half = std::clamp(head_n / 6, 2, 8);
  const auto step = [&](int i) { return sign * (profile.mean(i, i + half) - profile.mean(i - half, i)); };
  const int slack = std::max(2, head_n / 3);
  int peak = -1;
  double peak_value = 0;
  for (int i = std::max(half + 1, best - slack); i <= std::min(profile.size() - half - 1, best + slack); ++i) {
    if (step(i) > peak_value) {
      peak_value = step(i);
      peak = i;
    }
  }
  if (peak < 0 || peak_value < 0.5 * min_contrast) return std::nullopt;
  const double before = step(peak - 1);
  const double after = step(peak + 1);
  const double bend = before - 2 * peak_value + after;
  const double shift = bend < 0 ? std::clamp(0.5 * (before - after) / bend, -1.0, 1.0) : 0.0;
  // Border between samples peak - 1 and peak.
  const double head_grey = profile.mean(peak + 1, peak + 1 + crown_n);
  const double side_grey = profile.mean(peak - 1 - side_n, peak - 1);
  return Crossing{peak + shift - 0.5, best_contrast, std::max(head_grey, side_grey), std::min(head_grey, side_grey)};
}

}  // namespace

void EdgeBrightness::learn(const RailEdge& edge) {
  if (edge.brighter < kClearGrey || edge.brighter > kNearlyWhiteGrey || edge.darker < 1) return;
  count_ = std::min(count_ + 1, kRemembered);
  log_ratio_ += (std::log(edge.brighter / edge.darker) - log_ratio_) / count_;
}

// An edge is a ramp of one pixel from the darker to the brighter side; of what lies beyond white nothing is left, and
// the steepest place is the middle of the rest.
std::optional<double> EdgeBrightness::swallowed_px(double darker) const {
  const double usually_brighter = darker * std::exp(log_ratio_);
  if (count_ < kFewestLearnt || usually_brighter < kNoGlint * kWhiteGrey) return std::nullopt;
  const double truly_brighter = std::max(kWhiteGrey, usually_brighter);
  return 0.5 * (truly_brighter - kWhiteGrey) / std::max(1.0, truly_brighter - darker);
}

EdgeProfile::EdgeProfile() {
  values_.reserve(kUsualSamples);
  sums_.reserve(kUsualSamples + 1);
  steps_.reserve(kUsualSamples);
}

bool EdgeProfile::take(const cv::Mat& grey, const Eigen::Vector2d& first, const Eigen::Vector2d& outward_px,
                       const Eigen::Vector2d& along, int count) {
  values_.assign(static_cast<size_t>(count), 0.0);
  const Eigen::Vector2d last = first + outward_px * (count - 1);
  for (int k = -2; k <= 2; ++k) {
    const Eigen::Vector2d shift = along * k;
    if (!inside(grey, first + shift) || !inside(grey, last + shift)) return false;
    Eigen::Vector2d p = first + shift;
    for (auto& value : values_) {
      value += 0.2 * sample(grey, p.x(), p.y());
      p += outward_px;
    }
  }
  sums_.resize(values_.size() + 1);
  sums_[0] = 0;
  for (size_t i = 0; i < values_.size(); ++i) sums_[i + 1] = sums_[i] + values_[i];
  return true;
}

double EdgeProfile::mean(int first, int last) const {
  first = std::clamp(first, 0, size() - 1);
  last = std::clamp(last, first + 1, size());
  return (sums_[static_cast<size_t>(last)] - sums_[static_cast<size_t>(first)]) / (last - first);
}

double EdgeProfile::noise() {
  constexpr auto kPixel = static_cast<size_t>(1 / kStepPx);
  if (values_.size() <= kPixel) return 0;
  steps_.clear();
  for (size_t i = kPixel; i < values_.size(); ++i) steps_.push_back(std::abs(values_[i] - values_[i - kPixel]));
  const auto middle = steps_.begin() + static_cast<ptrdiff_t>(steps_.size() / 2);
  std::nth_element(steps_.begin(), middle, steps_.end());
  return *middle;
}

const std::vector<RailEdge>& EdgeFinder::find(const cv::Mat& grey, const geometry::Intrinsics& camera,
                                              const TrackShape& shape, const EdgeOptions& options, int tried[2]) {
  const geometry::View view(camera, shape.camera);
  const double ratio = std::pow(options.far_m / options.near_m, 1.0 / std::max(1, options.stations - 1));
  edges_.clear();
  edges_.reserve(2 * static_cast<size_t>(std::max(1, options.stations)));
  for (const auto side : {Side::left, Side::right}) {
    int& count = tried[side == Side::left ? 0 : 1];
    count = 0;
    for (int i = 0; i < options.stations; ++i) {
      const double ahead_m = options.near_m * std::pow(ratio, i);
      const auto inner = view.project(rail_point(shape, side, options.gauge_m, ahead_m));
      const auto outer = view.project(rail_point(shape, side, options.gauge_m, ahead_m, options.head_m));
      const auto next = view.project(rail_point(shape, side, options.gauge_m, ahead_m * 1.01));
      if (!inner || !outer || !next) continue;
      RailEdge edge;
      const auto look = find_at(grey, {*inner, *outer, *next}, options, brightness_[rail(side, options.dark)], edge);
      if (look == Look::outside) continue;
      ++count;
      if (look == Look::unclear) continue;
      edge.point.side = side;
      edge.ahead_m = ahead_m;
      edges_.push_back(edge);
    }
  }
  return edges_;
}

void EdgeFinder::learn(bool dark) {
  for (const auto& edge : edges_) brightness_[rail(edge.point.side, dark)].learn(edge);
}

EdgeFinder::Look EdgeFinder::find_at(const cv::Mat& grey, const Place& place, const EdgeOptions& options,
                                     const EdgeBrightness& brightness, RailEdge& edge) {
  const double head_px = (place.outer - place.inner).norm();
  if (head_px < options.smallest_head_px || !inside(grey, place.inner)) return Look::outside;
  const double px_per_m = head_px / options.head_m;
  const Eigen::Vector2d outward = (place.outer - place.inner) / head_px * kStepPx;
  const Eigen::Vector2d along = (place.next - place.inner).normalized();
  const double reach_px = std::max(options.reach_m * px_per_m, 2.0);
  const double side_px = std::max(kSideM * px_per_m, 1.5);
  const int before = static_cast<int>(std::ceil((reach_px + side_px) / kStepPx)) + 1;
  const int behind = static_cast<int>(std::ceil((reach_px + head_px + side_px) / kStepPx)) + 1;
  if (!profile_.take(grey, place.inner - outward * before, outward, along, before + behind + 1)) return Look::outside;
  const auto crossing =
      find_crossing(profile_, head_px / kStepPx, side_px / kStepPx, options.dark ? -1.0 : 1.0, options.min_contrast);
  if (!crossing) return Look::unclear;
  double at = crossing->at - before;
  edge.point.bias_sigma_px = kBiasPx;
  if (crossing->brighter > kBurntOutGrey) {
    const auto known_px = brightness.swallowed_px(crossing->darker);
    const double swallowed_px = known_px.value_or(kSwallowedPx);
    at += (options.dark ? -swallowed_px : swallowed_px) / kStepPx;
    edge.point.bias_sigma_px = known_px ? std::hypot(kBiasPx, kKnownSwallowedSigmaPx) : kSwallowedSigmaPx;
  }
  edge.point.pixel = place.inner + outward * at;
  edge.point.sigma_px = std::hypot(kEdgeSigmaPx, kEdgeSigmaM * px_per_m);
  edge.offset_m = at * kStepPx / px_per_m;
  edge.contrast = crossing->contrast;
  edge.noise = options.noise ? profile_.noise() : 0.0;
  edge.brighter = crossing->brighter;
  edge.darker = crossing->darker;
  return Look::found;
}

}  // namespace railfix::track_detector
