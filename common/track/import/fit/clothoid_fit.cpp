#include "track/import/fit/clothoid_fit.hpp"

#include <Eigen/Cholesky>
#include <Eigen/QR>
#include <algorithm>
#include <array>
#include <cmath>

#include "core/units.hpp"
#include "track/import/fit/curvature_profile.hpp"
#include "track/import/fit/plane.hpp"

namespace railfix::track {
namespace {

constexpr size_t kFewestPoints = 6;
constexpr size_t kFewestWithSigma = 3;
constexpr double kUsualWeighs = 4;    // points
constexpr size_t kMostPoints = 1500;  // the cost grows with their third power
constexpr double kLeastSigmaM = 0.02;
constexpr double kShortestM = 3.0;
constexpr double kSharpestFitPerM = 1.0 / 50.0;
constexpr int kFitSteps = 12;
constexpr int kClosingSteps = 5;
constexpr double kCurvatureStep = 1e-9;

/// Levenberg-Marquardt over the heading at the start, the curvatures and the inner knots.
class Refiner {
 public:
  Refiner(const CurvatureTarget& target, SparseProfile profile) : target_(target), best_(std::move(profile)) {}

  /// The refined profile, closed: where the steps ended before the end was met, the least change of the curvatures
  /// that meets it (the end is exact, the points have scatter).
  SparseProfile run() {
    refine();
    for (int step = 0; step < kClosingSteps && !close(); ++step) {
    }
    return best_;
  }

 private:
  void refine() {
    Eigen::VectorXd residual = residuals(best_);
    double cost = residual.squaredNorm();
    double damping = 1e-3;
    for (int step = 0; step < kFitSteps; ++step) {
      const Eigen::MatrixXd jacobian = derivatives(residual);
      Eigen::MatrixXd normal = jacobian.transpose() * jacobian;
      normal.diagonal() *= 1.0 + damping;
      normal.diagonal().array() += 1e-12;
      const Eigen::VectorXd change = Eigen::LDLT<Eigen::MatrixXd>(normal).solve(-jacobian.transpose() * residual);
      const SparseProfile tried = changed(best_, change);
      const Eigen::VectorXd after = residuals(tried);
      const double cost_after = after.allFinite() ? after.squaredNorm() : cost + 1;
      if (cost_after < cost) {
        const bool is_done = cost - cost_after < 1e-5 * cost;
        best_ = tried;
        residual = after;
        cost = cost_after;
        damping = std::max(0.2 * damping, 1e-9);
        if (is_done) break;
      } else {
        damping *= 10;
        if (damping > 1e6) break;
      }
    }
  }

  /// Metres beside the last point, and heading there off by so many radians (0 where it is free).
  [[nodiscard]] Eigen::Vector2d end_errors(const Eigen::VectorXd& residual) const {
    const auto count = static_cast<Eigen::Index>(target_.points.size());
    return {residual[count - 1] * kExactM, residual[count + 1] * kExactRad};
  }

  /// One step; true where there is nothing to do, or nothing to be done.
  bool close() {
    const Eigen::VectorXd residual = residuals(best_);
    const Eigen::Vector2d errors = end_errors(residual);
    if (best_.values.size() < 2 || !residual.allFinite() ||
        (std::abs(errors[0]) < kExactM && std::abs(errors[1]) < kExactRad))
      return true;
    const auto values = static_cast<Eigen::Index>(best_.values.size());
    Eigen::MatrixXd slope(2, values - 1);  // of the errors, by every curvature
    for (Eigen::Index i = 1; i < values; ++i) {
      Eigen::VectorXd change = Eigen::VectorXd::Zero(size());
      change[i] = kCurvatureStep;
      slope.col(i - 1) = (end_errors(residuals(changed(best_, change))) - errors) / kCurvatureStep;
    }
    if (!slope.allFinite()) return true;
    Eigen::VectorXd change = Eigen::VectorXd::Zero(size());
    change.segment(1, values - 1) = slope.completeOrthogonalDecomposition().solve(-errors);
    const SparseProfile tried = changed(best_, change);
    const Eigen::Vector2d after = end_errors(residuals(tried));
    // The two need each other: a turn of the end moves it sideways for a step.
    const auto size_of = [](const Eigen::Vector2d& e) { return std::hypot(e[0] / kExactM, 0.1 * e[1] / kExactRad); };
    if (!(size_of(after) < size_of(errors))) return true;
    best_ = tried;
    return false;
  }

  [[nodiscard]] size_t inner_knots() const { return best_.at_m.size() - 2; }
  [[nodiscard]] Eigen::Index size() const {
    return static_cast<Eigen::Index>(1 + best_.values.size() - 1 + inner_knots());
  }

  /// Infinite where the profile is no track.
  [[nodiscard]] Eigen::VectorXd residuals(const SparseProfile& profile) const {
    const CurvatureProfile dense = profile.dense();
    if (!dense.is_plausible())
      return Eigen::VectorXd::Constant(static_cast<Eigen::Index>(target_.points.size() + 2), HUGE_VAL);
    const Alignment track = dense.alignment();
    const std::vector<double> stations = stations_of(track, target_.points);
    Eigen::VectorXd out(static_cast<Eigen::Index>(target_.points.size() + 2));
    const auto count = static_cast<Eigen::Index>(target_.points.size());
    out.head(count) = distances_of(track, target_.points, stations) / target_.sigma_m;
    out[count - 1] *= target_.sigma_m / kExactM;
    // Where the track will be cut, or carried on to, beside the last point.
    const double end_m = std::min(stations.back(), track.length_m());
    const double end = track.at(end_m).pose.heading_rad - track.curvature_at(end_m) * (stations.back() - end_m);
    out[count] = target_.heading_at_start
                     ? core::wrap_pi(profile.start.heading_rad - *target_.heading_at_start) / kExactRad
                     : 0.0;
    out[count + 1] = target_.heading_at_end ? core::wrap_pi(end - *target_.heading_at_end) / kExactRad : 0.0;
    return out;
  }

  [[nodiscard]] Eigen::MatrixXd derivatives(const Eigen::VectorXd& residual) const {
    Eigen::MatrixXd out(residual.size(), size());
    for (Eigen::Index i = 0; i < size(); ++i) {
      const double step = i == 0 ? 1e-7 : i < static_cast<Eigen::Index>(best_.values.size()) ? kCurvatureStep : 1e-2;
      Eigen::VectorXd change = Eigen::VectorXd::Zero(size());
      change[i] = step;
      out.col(i) = (residuals(changed(best_, change)) - residual) / step;
    }
    return out;
  }

  /// Knots keep their order and a little room.
  static SparseProfile changed(const SparseProfile& from, const Eigen::VectorXd& change) {
    SparseProfile out = from;
    out.start.heading_rad += change[0];
    Eigen::Index at = 1;
    for (size_t i = 1; i < out.values.size(); ++i) out.values[i] += change[at++];
    for (size_t i = 1; i + 1 < out.at_m.size(); ++i) {
      const double room = 0.3 * std::min(from.at_m[i] - from.at_m[i - 1], from.at_m[i + 1] - from.at_m[i]);
      out.at_m[i] += std::clamp(change[at++], -room, room);
      if (out.at_m[i] - out.at_m[i - 1] < kShortestM) out.at_m[i] = from.at_m[i];
    }
    return out;
  }

  const CurvatureTarget& target_;
  SparseProfile best_;
};

/// Neighbouring spans of one curvature are one element; the last ends beside the last point.
Alignment merged(const SparseProfile& profile, const std::vector<Eigen::Vector2d>& points) {
  const double length = stations_of(profile.dense().alignment(), points).back();
  std::vector<Element> elements;
  bool was_constant = false;
  size_t value = 0;
  for (size_t i = 0; i + 1 < profile.at_m.size(); ++i) {
    const bool is_last = i + 2 == profile.at_m.size();
    const double span = std::max((is_last ? length : profile.at_m[i + 1]) - profile.at_m[i], 0.01);
    const bool is_constant = profile.value[i] == profile.value[i + 1];
    if (is_constant && was_constant && value == profile.value[i]) {
      elements.back().length_m += span;
    } else {
      // A clothoid that is cut keeps its rate, not the curvature that it would have had at its end.
      const double begins = profile.values[profile.value[i]];
      const double part = is_last ? span / (profile.at_m[i + 1] - profile.at_m[i]) : 1.0;
      elements.push_back({span, begins, begins + part * (profile.values[profile.value[i + 1]] - begins)});
    }
    was_constant = is_constant;
    value = profile.value[i + 1];
  }
  return Alignment::chained(profile.start, std::move(elements));
}

/// The scatter of few points says little: the usual one has its say.
double sigma_for(const std::vector<Eigen::Vector2d>& points, const ClothoidFitOptions& options) {
  double sigma = options.sigma_m > 0 ? options.sigma_m : scatter_of(points);
  if (!(options.sigma_m > 0) && options.usual_sigma_m > 0) {
    const double own = points.size() > 4 ? static_cast<double>(points.size() - 4) : 0.0;
    sigma = std::sqrt((own * sigma * sigma + kUsualWeighs * std::pow(options.usual_sigma_m, 2)) / (own + kUsualWeighs));
  }
  return std::max(sigma, kLeastSigmaM);
}

bool is_sound(const CurvatureProfile& profile, const Eigen::MatrixXd& covariance) {
  return profile.at_m.size() >= 2 && covariance.allFinite() && profile.is_plausible();
}

void judge(const std::vector<Eigen::Vector2d>& points, ClothoidFit& fit, std::vector<double>& off_m) {
  const std::vector<double> stations = stations_of(fit.alignment, points);
  const Eigen::VectorXd off = distances_of(fit.alignment, points, stations);
  fit.element_max_m.assign(fit.alignment.elements().size(), 0.0);
  const std::vector<double>& offsets = fit.alignment.element_offsets();
  for (size_t i = 0; i < points.size(); ++i) {
    const auto after = std::upper_bound(offsets.begin(), offsets.end(), stations[i]) - offsets.begin();
    double& worst = fit.element_max_m[static_cast<size_t>(std::max<ptrdiff_t>(after - 1, 0))];
    worst = std::max(worst, std::abs(off[static_cast<Eigen::Index>(i)]));
  }
  off_m.assign(off.begin(), off.end());
  fit.rms_m = std::sqrt(off.squaredNorm() / static_cast<double>(points.size()));
  fit.max_m = off.cwiseAbs().maxCoeff();
}

/// Between points far apart a fit may bow to anywhere. An arc's sagitta is at most a quarter of its chord times the
/// turn at either end of the chord; more than twice that, and more than a point may lie off, is not told by the points.
bool bows_out(const Alignment& track, const std::vector<Eigen::Vector2d>& points, double limit_m) {
  const auto turn_at = [&](size_t i) {
    if (i == 0 || i + 1 >= points.size()) return 0.0;
    const Eigen::Vector2d before = points[i] - points[i - 1];
    const Eigen::Vector2d after = points[i + 1] - points[i];
    return std::abs(core::wrap_pi(heading_of(after) - heading_of(before)));
  };
  const std::vector<double> stations = stations_of(track, points);
  for (size_t i = 0; i + 1 < points.size(); ++i) {
    const Eigen::Vector2d chord = points[i + 1] - points[i];
    const double most = limit_m + 0.5 * chord.norm() * std::max(turn_at(i), turn_at(i + 1));
    for (const double part : {0.25, 0.5, 0.75}) {
      const PlanPose pose = track.at(stations[i] + part * (stations[i + 1] - stations[i])).pose;
      const Eigen::Vector2d away = Eigen::Vector2d(pose.easting_m, pose.northing_m) - points[i];
      if (std::abs(chord.x() * away.y() - chord.y() * away.x()) / chord.norm() > most) return true;
    }
  }
  return false;
}

bool is_track(const Alignment& track) {
  return std::all_of(track.elements().begin(), track.elements().end(), [](const Element& element) {
    return std::isfinite(element.length_m) && std::abs(element.curvature_start_per_m) < kSharpestFitPerM &&
           std::abs(element.curvature_end_per_m) < kSharpestFitPerM;
  });
}

}  // namespace

void FitReport::add(const std::string& track, const ClothoidFit& fit, size_t points_of_track) {
  ++tracks;
  points += points_of_track;
  squared_sum_m2 += fit.rms_m * fit.rms_m * static_cast<double>(points_of_track);
  max_m = std::max(max_m, fit.max_m);
  left_out += fit.left_out;
  arcs_m += fit.arcs_m;
  for (size_t i = 0; i < fit.element_max_m.size(); ++i) {
    elements.push_back({track, fit.alignment.element_offsets()[i], fit.alignment.elements()[i], fit.element_max_m[i]});
  }
}

double FitReport::rms_m() const {
  return points > 0 ? std::sqrt(squared_sum_m2 / static_cast<double>(points)) : 0.0;
}

std::vector<double> apart_from_neighbours(const std::vector<Eigen::Vector2d>& points) {
  std::vector<double> off(points.size(), 0.0);
  for (size_t i = 2; i + 2 < points.size(); ++i) {
    std::array<double, 4> at{};
    const std::array<size_t, 4> near{i - 2, i - 1, i + 1, i + 2};
    for (size_t k = 0; k < 4; ++k) at[k] = (points[near[k]] - points[i]).norm() * (k < 2 ? -1.0 : 1.0);
    // Lagrange weights of the cubic through the four at the point, and what its own error adds.
    Eigen::Vector2d expected = Eigen::Vector2d::Zero();
    double variance = 1;
    for (size_t k = 0; k < 4; ++k) {
      double weight = 1;
      for (size_t other = 0; other < 4; ++other) {
        if (other != k) weight *= -at[other] / (at[k] - at[other]);
      }
      expected += weight * points[near[k]];
      variance += weight * weight;
    }
    const Eigen::Vector2d along = (points[i + 1] - points[i - 1]).normalized();
    const Eigen::Vector2d away = points[i] - expected;
    off[i] = std::abs(along.x() * away.y() - along.y() * away.x()) / std::sqrt(variance);
  }
  return off;
}

double scatter_of(const std::vector<Eigen::Vector2d>& points) {
  if (points.size() < 5) return 0;
  std::vector<double> off = apart_from_neighbours(points);
  off = {off.begin() + 2, off.end() - 2};
  const auto middle = off.begin() + static_cast<ptrdiff_t>(off.size() / 2);
  std::nth_element(off.begin(), middle, off.end());
  return *middle / 0.6745;
}

double fit_limit_m(double sigma_m) {
  return std::max(6.0 * sigma_m, 0.5);
}

std::optional<ClothoidFit> fit_somehow(const std::vector<Eigen::Vector2d>& points, const ClothoidFitOptions& options,
                                       std::vector<double>& off_m) {
  const size_t fewest = options.usual_sigma_m > 0 ? kFewestWithSigma : kFewestPoints;
  if (points.size() < fewest || points.size() > kMostPoints) return std::nullopt;
  ClothoidFit fit;
  fit.sigma_m = sigma_for(points, options);
  const CurvatureTarget target{points, fit.sigma_m, options.heading_at_start, options.heading_at_end};
  Eigen::MatrixXd covariance;
  const CurvatureProfile dense = dense_profile(target, covariance);
  if (!is_sound(dense, covariance)) return std::nullopt;
  const SparseProfile sparse = Refiner(target, simplified(dense, std::move(covariance))).run();
  fit.alignment = merged(sparse, points);
  if (!is_track(fit.alignment) || bows_out(fit.alignment, points, fit_limit_m(fit.sigma_m))) return std::nullopt;
  judge(points, fit, off_m);
  return fit;
}

std::optional<ClothoidFit> fit_clothoids(const std::vector<Eigen::Vector2d>& points,
                                         const ClothoidFitOptions& options) {
  std::vector<double> off_m;
  std::optional<ClothoidFit> fit = fit_somehow(points, options, off_m);
  if (fit && !(fit->max_m < fit_limit_m(fit->sigma_m))) fit.reset();
  return fit;
}

}  // namespace railfix::track
