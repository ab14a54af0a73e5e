#include "track_detector/edge_tracker.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

namespace railfix::track_detector {
namespace {

constexpr double kFirstBearing = 0.06;    // an edge is taken up from here ...
constexpr double kLastBearing = 0.75;     // ... to here, share of the widest one
constexpr double kBearingSigma = 0.0012;  // of one edge, yaw of the pose included
constexpr double kLeastSigma = 0.0007;    // what does not average out
constexpr double kUsualLateralM = 3.5;
constexpr double kInverseSigma = 0.12;  // 1/m
constexpr double kGateSigmas = 3.0;
constexpr double kGate = 0.003;
constexpr double kGrowth = 1.3;      // of the bearing while it is followed
constexpr double kWorstFit = 0.004;  // bearing
constexpr int kFewestPictures = 5;
constexpr double kBesideBearing = 0.03;  // a new edge so near a known one belongs to the same thing
constexpr double kSeenShare = 0.6;
constexpr int kMostMissed = 3;
constexpr size_t kMostTracks = 150;
constexpr double kNearestLateralM = 1.5;
constexpr double kFarthestLateralM = 14.0;
constexpr double kBendShare = 0.30;  // of the curvature, unknown
constexpr double kCorrelated = 4.0;  // so many neighbouring measurements err together

// Bearing of a place (arc length and lateral offset of a track of constant curvature) seen from the track's foot.
double bearing_of(double along_m, double lateral_m, double curvature_per_m, double eye_lateral_m) {
  const double turn = curvature_per_m * along_m;
  const double x = along_m * (1 - turn * turn / 6) - lateral_m * turn;
  const double y = 0.5 * along_m * turn + lateral_m * (1 - 0.5 * turn * turn) - eye_lateral_m;
  return y / std::max(0.5, x);
}

}  // namespace

EdgeTracker::EdgeTracker() {
  tracks_.reserve(kMostTracks);
  settled_.reserve(kMostTracks);
  used_.reserve(kMostTracks);
}

void EdgeTracker::forget() {
  tracks_.clear();
}

void EdgeTracker::predict(Track& track, double way_m) {
  const double step_m = way_m - track.way_m;
  track.way_m = way_m;
  track.ratio -= step_m * track.inverse_m;
  track.p00 += step_m * step_m * track.p11 - 2 * step_m * track.p01;
  track.p01 -= step_m * track.p11;
  track.hit = false;
}

// The bearing that the edge would have on straight track, seen from the track centre.
double EdgeTracker::straightened(const Track& track, double bearing, const LandmarkPicture& picture) {
  const double ahead_m = std::clamp(track.ahead_m(), 2.0, 40.0);
  const double lateral_m = track.side / track.inverse_m;
  return bearing * (1 - picture.curvature_per_m * lateral_m) - 0.5 * picture.curvature_per_m * ahead_m +
         picture.pose.lateral_m / ahead_m;
}

void EdgeTracker::remember(Track& track, const EdgeMeasurement& measurement) {
  if (track.count == kMostMeasurements) {
    for (size_t i = 0; 2 * i < kMostMeasurements; ++i) track.measured[i] = track.measured[2 * i + 1];
    track.count = kMostMeasurements / 2;
  }
  track.measured[track.count++] = measurement;
}

void EdgeTracker::update(Track& track, const UprightEdge& edge, const LandmarkPicture& picture) {
  const double bearing = std::max(0.02, track.side * straightened(track, edge.bearing, picture));
  const double innovation = 1 / bearing - track.ratio;
  const double sigma = kBearingSigma / (bearing * bearing);
  const double variance = track.p00 + sigma * sigma;
  const double k0 = track.p00 / variance;
  const double k1 = track.p01 / variance;
  track.ratio += k0 * innovation;
  track.inverse_m = std::clamp(track.inverse_m + k1 * innovation, 1 / kFarthestLateralM, 1 / kNearestLateralM);
  track.p11 -= k1 * track.p01;
  track.p01 -= k0 * track.p01;
  track.p00 -= k0 * track.p00;
  track.inner_grey += edge.inner_grey;
  track.outer_grey += edge.outer_grey;
  track.deep_grey += edge.deep_grey;
  track.hit = true;
  track.missed = 0;
  ++track.seen;
  remember(track, {track.way_m, edge.bearing, picture.curvature_per_m, picture.pose.lateral_m});
}

const std::vector<SettledEdge>& EdgeTracker::follow(const std::vector<UprightEdge>& found,
                                                    const LandmarkPicture& picture, double way_m, double widest) {
  settled_.clear();
  used_.assign(found.size(), 0);
  for (Track& track : tracks_) predict(track, way_m);
  // The longest followed choose first.
  std::sort(tracks_.begin(), tracks_.end(), [](const Track& a, const Track& b) { return a.seen > b.seen; });
  for (Track& track : tracks_) {
    const double expected = track.bearing();
    const double gate = kGate + kGateSigmas * std::sqrt(std::max(0.0, track.p00)) * expected * expected +
                        0.15 * std::abs(picture.curvature_per_m) * std::min(track.ahead_m(), 30.0);
    size_t best = found.size();
    double nearest = gate;
    for (size_t i = 0; i < found.size(); ++i) {
      if (used_[i] != 0 || found[i].contrast() * track.sign < 0) continue;
      const double off = std::abs(straightened(track, found[i].bearing, picture) - expected);
      if (off < nearest) {
        nearest = off;
        best = i;
      }
    }
    if (best < found.size()) {
      used_[best] = 1;
      update(track, found[best], picture);
    } else {
      ++track.missed;
      ++track.gaps;
    }
  }
  for (const Track& track : tracks_) {
    if (track.missed <= kMostMissed && std::abs(track.bearing()) < widest) continue;
    if (const auto settled = settle(track)) settled_.push_back(*settled);
  }
  std::erase_if(tracks_, [widest](const Track& track) {
    return track.missed > kMostMissed || std::abs(track.bearing()) >= widest;
  });
  for (size_t i = 0; i < found.size() && tracks_.size() < kMostTracks; ++i) {
    if (used_[i] != 0 || std::abs(found[i].bearing) < kFirstBearing || std::abs(found[i].bearing) > 0.5 * widest)
      continue;
    Track track;
    track.side = found[i].bearing > 0 ? 1 : -1;
    track.sign = found[i].contrast() > 0 ? 1 : -1;
    track.way_m = way_m;
    track.inverse_m = 1 / kUsualLateralM;
    track.ratio = 1 / std::abs(found[i].bearing);
    track.p00 = std::pow(10 * kBearingSigma / (found[i].bearing * found[i].bearing), 2);
    track.p11 = kInverseSigma * kInverseSigma;
    for (const Track& known : tracks_) {
      const double off = std::abs(known.bearing() - found[i].bearing);
      if (known.seen < kFewestPictures || off > kBesideBearing) continue;
      track.inverse_m = known.inverse_m;
      track.p11 = 4 * known.p11;
      break;
    }
    update(track, found[i], picture);
    tracks_.push_back(track);
  }
  return settled_;
}

// Place and lateral offset from all bearings (Gauss-Newton, Cauchy weights).
std::optional<SettledEdge> EdgeTracker::settle(const Track& track) {
  if (track.seen < kFewestPictures || track.count < kFewestPictures) return std::nullopt;
  if (track.seen < kSeenShare * (track.seen + track.gaps)) return std::nullopt;
  const double growth = track.measured[track.count - 1].bearing / track.measured[0].bearing;
  if (growth < kGrowth) return std::nullopt;
  double place_m = track.way_m + track.ahead_m();
  double lateral_m = track.side / track.inverse_m;
  Eigen::Matrix2d normal;
  double rms = 0;
  for (int pass = 0; pass < 8; ++pass) {
    normal.setZero();
    Eigen::Vector2d right = Eigen::Vector2d::Zero();
    double squared = 0;
    double weights = 0;
    for (size_t i = 0; i < track.count; ++i) {
      const EdgeMeasurement& m = track.measured[i];
      const double along_m = std::max(1.0, place_m - m.way_m);
      const double model = bearing_of(along_m, lateral_m, m.curvature_per_m, m.eye_lateral_m);
      const double residual = m.bearing - model;
      const Eigen::Vector2d slope(
          (bearing_of(along_m + 0.01, lateral_m, m.curvature_per_m, m.eye_lateral_m) - model) / 0.01, 1 / along_m);
      // How the track bends on the way there is not well known.
      const double bend = 0.5 * kBendShare * std::abs(m.curvature_per_m) * along_m;
      const double variance = 1 + std::pow(bend / kBearingSigma, 2);
      const double weight = 1 / (variance + std::pow(residual / (2 * kBearingSigma), 2));
      normal += weight * slope * slope.transpose();
      right += weight * slope * residual;
      squared += weight * residual * residual;
      weights += weight;
    }
    if (!(std::abs(normal.determinant()) > 1e-20)) return std::nullopt;
    const Eigen::Vector2d step = normal.ldlt().solve(right);
    place_m += std::clamp(step(0), -2.0, 2.0);
    lateral_m += std::clamp(step(1), -1.0, 1.0);
    rms = std::sqrt(squared / weights);
  }
  if (rms > kWorstFit || lateral_m * track.side < kNearestLateralM || lateral_m * track.side > kFarthestLateralM) {
    return std::nullopt;
  }
  const double sigma = std::max(rms, kLeastSigma);
  const Eigen::Matrix2d covariance = normal.inverse() * (sigma * sigma * kCorrelated);
  return SettledEdge{place_m,
                     lateral_m,
                     std::sqrt(covariance(0, 0)),
                     std::sqrt(covariance(1, 1)),
                     track.inner_grey / track.seen,
                     track.outer_grey / track.seen,
                     track.deep_grey / track.seen,
                     track.seen,
                     track.count,
                     track.measured};
}

}  // namespace railfix::track_detector
