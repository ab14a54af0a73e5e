#include "track_detector/mount_calibration.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>

#include "core/median.hpp"

namespace railfix::track_detector {
namespace {

constexpr size_t kRoughPictures = 6;
constexpr size_t kVotingPictures = 20;
constexpr size_t kMinStraight = 3;
constexpr double kRollHeldRad = 1e-5;
constexpr double kStraightPerM = 3e-4;  // and within two sigmas of zero
// A pose that no picture knows anything about: cabs are 1.6 to 4.2 m high, cameras look up to 20 degrees down.
constexpr double kRoughHeightsM[] = {2.0, 2.8, 3.7};
constexpr double kRoughPitchesRad[] = {0.0, 0.12, 0.24};
constexpr double kRoughYawsRad[] = {0.0, -0.2, 0.2};
constexpr double kRoughLateralsM[] = {0.0, -0.9, 0.9};
constexpr double kUsualLateralM = 1.0;
// What all pictures err by alike: how rails bend upwards and downwards is taken for pitch, and the gauge of track in
// service is a few millimetres off.
constexpr geometry::CameraPose kShared{0, 1.5e-3, 8e-4, 0.003, 0.002};
constexpr double kGaugeOffM = 0.003;
constexpr TrackShapeSigma kRoughLimits{kRollHeldRad, 0.025, 0.04, 0.2, 0.18, 0.001, 0.0005, 3e-5};
constexpr TrackShapeSigma kAnywhereLimits{kRollHeldRad, 0.025, 0.04, 0.2, 0.18, 0.003, 0.0005, 3e-5};
constexpr TrackShapeSigma kFineLimits{kRollHeldRad, 0.012, 0.02, 0.10, 0.06, 0.003, 0.0005, 3e-5};

std::vector<geometry::CameraPose> rough_starts() {
  std::vector<geometry::CameraPose> starts;
  for (const double height_m : kRoughHeightsM) {
    for (const double pitch_rad : kRoughPitchesRad) {
      for (const double yaw_rad : kRoughYawsRad) {
        for (const double lateral_m : kRoughLateralsM) starts.push_back({0, pitch_rad, yaw_rad, lateral_m, height_m});
      }
    }
  }
  return starts;
}

/// How sure it is that these are the own rails: a cab camera sits between them, or little beside.
double plausible(const TrackObservation& o) {
  const double lateral = o.shape.camera.lateral_m / kUsualLateralM;
  return o.confidence / (1 + lateral * lateral);
}

double median(std::vector<double> values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

constexpr double geometry::CameraPose::*kMembers[] = {&geometry::CameraPose::pitch_rad, &geometry::CameraPose::yaw_rad,
                                                      &geometry::CameraPose::lateral_m,
                                                      &geometry::CameraPose::height_m};

/// Median pose; `spread` gets the robust standard deviation (1.4826 * median absolute deviation).
geometry::CameraPose median_pose(const std::vector<TrackObservation>& observations, geometry::CameraPose* spread) {
  geometry::CameraPose middle;
  for (const auto member : kMembers) {
    std::vector<double> values;
    values.reserve(observations.size());
    for (const auto& o : observations) values.push_back(o.shape.camera.*member);
    middle.*member = median(values);
    for (auto& value : values) value = std::abs(value - middle.*member);
    if (spread != nullptr) spread->*member = core::kSigmaOfMedian * median(values);
  }
  return middle;
}

/// A camera swings for a second or so: pictures that follow each other closely, in this order, count less than their
/// number (effective sample size of a first-order autoregression).
double independent(const std::vector<double>& values) {
  const auto count = static_cast<double>(values.size());
  double mean = 0;
  for (const double value : values) mean += value / count;
  double all = 0;
  double next = 0;
  for (size_t i = 0; i < values.size(); ++i) {
    all += (values[i] - mean) * (values[i] - mean);
    if (i > 0) next += (values[i] - mean) * (values[i - 1] - mean);
  }
  const double alike = all > 0 ? std::clamp(next / all, 0.0, 1.0) : 0.0;
  return std::max(1.0, count * (1 - alike) / (1 + alike));
}

}  // namespace

MountCalibrator::MountCalibrator(const geometry::Intrinsics& camera, double gauge_m, double roll_rad,
                                 const geometry::Intrinsics& lens_sigma)
    : camera_(camera), gauge_m_(gauge_m), roll_rad_(roll_rad), lens_sigma_(lens_sigma) {}

std::vector<TrackObservation> MountCalibrator::look(const geometry::CameraPose& start, const TrackShapeSigma& limits,
                                                    size_t max_pictures) const {
  DetectorOptions options;
  options.gauge_m = gauge_m_;
  options.limits = limits;
  geometry::CameraPose rolled = start;
  rolled.roll_rad = roll_rad_;
  TrackDetector detector(camera_, rolled, options);
  const size_t stride = std::max<size_t>(1, pictures_.size() / max_pictures);
  std::vector<TrackObservation> seen;
  for (size_t i = 0; i < pictures_.size(); i += stride) {
    detector.reset();
    auto observation = detector.detect(pictures_[i]);
    if (observation.seen()) seen.push_back(std::move(observation));
  }
  return seen;
}

// Every start is tried on a few pictures; what was found best in each of them, and the median of the best start, are
// then put to the vote: one picture may show a fence at the gauge, but not all of them at the same place.
core::Result<geometry::CameraPose> MountCalibrator::rough() const {
  std::vector<TrackObservation> best_start;
  double best_score = 0;
  std::vector<TrackObservation> best_of(pictures_.size());
  const size_t stride = std::max<size_t>(1, pictures_.size() / kRoughPictures);
  DetectorOptions options;
  options.gauge_m = gauge_m_;
  options.limits = kRoughLimits;
  for (const auto& start : rough_starts()) {
    TrackDetector detector(camera_, start, options);
    std::vector<TrackObservation> seen;
    double score = 0;
    for (size_t i = 0; i < pictures_.size(); i += stride) {
      detector.reset();
      auto observation = detector.detect(pictures_[i]);
      if (!observation.seen()) continue;
      score += plausible(observation);
      if (!best_of[i].seen() || plausible(observation) > plausible(best_of[i])) best_of[i] = observation;
      seen.push_back(std::move(observation));
    }
    if (score <= best_score) continue;
    best_score = score;
    best_start = std::move(seen);
  }
  if (best_start.empty()) {
    return core::Error{
        "no picture shows two rails at the gauge: use pictures of straight track in good light, give --focal "
        "or --camera, and check --gauge"};
  }
  std::vector<geometry::CameraPose> candidates{median_pose(best_start, nullptr)};
  for (const auto& o : best_of) {
    if (o.seen()) candidates.push_back(o.shape.camera);
  }
  return elected(candidates);
}

geometry::CameraPose MountCalibrator::elected(const std::vector<geometry::CameraPose>& candidates) const {
  geometry::CameraPose best = candidates.front();
  double best_score = -1;
  for (const auto& candidate : candidates) {
    double score = 0;
    for (const auto& o : look(candidate, kFineLimits, kVotingPictures)) score += plausible(o);
    if (score <= best_score) continue;
    best_score = score;
    best = candidate;
  }
  return best;
}

core::Result<MountCalibration> MountCalibrator::solve() const {
  if (pictures_.empty()) return core::Error{"there is no picture to calibrate from"};
  const auto start = rough();
  if (!start.ok()) return start.error();
  MountCalibration result;
  result.pictures = pictures_.size();
  auto seen = look(start.value(), kFineLimits, pictures_.size());
  result.seen = seen.size();
  std::erase_if(seen, [](const TrackObservation& o) {
    const double sigma = std::sqrt(std::max(0.0, o.covariance(5, 5)));
    return std::abs(o.shape.curvature_per_m) > std::max(kStraightPerM, 2 * sigma);
  });
  result.straight = seen.size();
  if (const auto enough = check_enough(result); !enough.ok()) return enough.error();
  geometry::CameraPose spread;
  result.mount = median_pose(seen, &spread);
  add_sigmas(seen, spread, result);
  result.mount.roll_rad = roll_rad_;
  add_lens(result);
  std::vector<double> residuals;
  residuals.reserve(seen.size());
  for (const auto& o : seen) residuals.push_back(o.residual_px);
  result.residual_px = median(residuals);
  return result;
}

TrackObservation find_rails_anywhere(const geometry::Intrinsics& camera, const cv::Mat& grey, double gauge_m) {
  DetectorOptions options;
  options.gauge_m = gauge_m;
  options.limits = kAnywhereLimits;
  TrackObservation best;
  best.reason = "no pair of rails at the gauge";
  double best_score = 0;
  for (const auto& start : rough_starts()) {
    TrackDetector detector(camera, start, options);
    auto observation = detector.detect(grey);
    const double score = observation.seen() ? plausible(observation) : 0;
    if (score <= best_score) continue;
    best_score = score;
    best = std::move(observation);
  }
  return best;
}

void MountCalibrator::add_sigmas(const std::vector<TrackObservation>& seen, const geometry::CameraPose& spread,
                                 MountCalibration& result) const {
  for (int k = 0; const auto member : kMembers) {
    ++k;  // of the covariance, which begins with roll
    std::vector<double> own;
    std::vector<double> values;
    for (const auto& o : seen) {
      own.push_back(std::sqrt(std::max(0.0, o.covariance(k, k))));
      values.push_back(o.shape.camera.*member);
    }
    // The scatter over pictures holds the shake; a median is 1.25 times as uncertain as a mean.
    const double scatter = 1.25 * std::max(spread.*member, median(own)) / std::sqrt(independent(values));
    result.sigma.*member = std::hypot(scatter, kShared.*member);
  }
  result.sigma.height_m = std::hypot(result.sigma.height_m, result.mount.height_m * kGaugeOffM / gauge_m_);
}

core::Status MountCalibrator::check_enough(const MountCalibration& result) {
  char text[300];
  if (2 * result.seen < result.pictures) {
    std::snprintf(text, sizeof text,
                  "only %zu of %zu pictures show both rails where this mount would have them, so that it is not to be "
                  "believed: give the right --focal or --camera and --gauge, and pictures in good light",
                  result.seen, result.pictures);
    return core::Error{text};
  }
  if (result.straight >= kMinStraight) return {};
  std::snprintf(
      text, sizeof text,
      "only %zu of %zu pictures show both rails of straight track, at least %zu are needed: take more pictures",
      result.straight, result.pictures, kMinStraight);
  return core::Error{text};
}

/// A wrong principal point is taken for pitch and yaw, a wrong focal length scales their tangents.
void MountCalibrator::add_lens(MountCalibration& result) const {
  const auto& m = result.mount;
  const auto more = [](double sigma, double a, double b) { return std::sqrt(sigma * sigma + a * a + b * b); };
  result.sigma.pitch_rad = more(result.sigma.pitch_rad, lens_sigma_.cv_px / camera_.fv_px,
                                std::tan(m.pitch_rad) * lens_sigma_.fv_px / camera_.fv_px);
  result.sigma.yaw_rad = more(result.sigma.yaw_rad, lens_sigma_.cu_px / camera_.fu_px,
                              std::tan(m.yaw_rad) * lens_sigma_.fu_px / camera_.fu_px);
}

}  // namespace railfix::track_detector
