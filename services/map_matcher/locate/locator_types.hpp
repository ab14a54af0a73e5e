// What the parts of the search on the whole network share: parameters, the measured way, and how well a turn fits.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "track/ways.hpp"

namespace railfix::map_matcher {

struct LocatorParameters {
  double window_m = 6000;            // longest way that is searched for
  double least_way_m = 800;          // shorter ways are not searched for
  double least_turn_rad = 0.1;       // nor ways that bend less (sum of the turns, left and right)
  double scale_range = 0.02;         // of the odometer
  double noise_per_m = 1e-4;         // least sigma of the measured curvature over 20 m
  double bias_per_m = 1e-4;          // constant error of the measured curvature, one sigma
  double heading_sigma_rad = 0.008;  // of the body against the mapped track ...
  double heading_m = 50.0;           // ... which changes over such a way
  double curvature_share = 0.05;     // of the mapped curvature
  double correlated_bins = 1.5;      // neighbouring bins err together
  double lag_m = 20.0;               // the body's heading is the mean of the track's over so much behind the foot
  double detection = 0.8;            // chance that a mapped landmark is sighted
  double false_per_m = 0.0005;
  double certain = 0.9999;        // probability from which on the place is certain ...
  double certain_misfit = 1.3;    // ... when the bins fit to so many sigmas squared in the mean (or to
                                  // most_misfit(), and much speaks for it) ...
  double certain_sigma_m = 20.0;  // ... and the place along the track to this sigma

  /// Worse than that the track is another one, or the map is wrong.
  [[nodiscard]] double most_misfit() const { return std::max(2.0, certain_misfit); }
  /// Likelihood of a sighting so far from a mapped landmark, where the place is known to rough_m.
  [[nodiscard]] double mark_density(double off_m, double rough_m) const {
    constexpr double kSigmaM = 4.0;
    const double z = std::max(0.0, std::abs(off_m) - rough_m) / kSigmaM;
    return z > 6 ? 0.0 : detection * std::exp(-0.5 * z * z) / (kSigmaM * 2.5066);
  }
};

/// A landmark as the locator sees it; portals in and out are the same, since the direction is not known.
struct Mark {
  double along_m = 0;
  track::LandmarkKind kind = track::LandmarkKind::unknown;
  double lateral_m = 0;
};
/// Of these kinds each is an event for itself; masts stand everywhere.
constexpr bool is_mark(track::LandmarkKind kind) {
  using Kind = track::LandmarkKind;
  return kind == Kind::balise || kind == Kind::frog || kind == Kind::bridge || kind == Kind::platform ||
         kind == Kind::portal_in || kind == Kind::portal_out;
}
constexpr track::LandmarkKind mark_kind(track::LandmarkKind kind) {
  return kind == track::LandmarkKind::portal_out ? track::LandmarkKind::portal_in : kind;
}
/// Of the same kind, and not on the other rail (frogs).
inline bool alike(const Mark& a, const Mark& b) {
  constexpr double kClearSideM = 0.3;
  const bool sides = std::abs(a.lateral_m) > kClearSideM && std::abs(b.lateral_m) > kClearSideM;
  return a.kind == b.kind && !(sides && (a.lateral_m > 0) != (b.lateral_m > 0));
}

/// 20 m of the measured way.
struct MeasuredBin {
  double turn_rad = 0;
  double variance = 0;
  std::vector<Mark> marks;  // sighted, from the bin's beginning
};
constexpr double kBinM = 20.0;
using MeasuredWay = std::vector<MeasuredBin>;  // oldest first

/// A place that may be the one: where bin `bin` begins.
struct Candidate {
  track::Run run;
  double into_m = 0;
  size_t bin = 0;
  double scale = 1;  // true over measured metres, as good as known
  double scale_sigma = 0;
  double log = 0;  // likelihood
};

/// Errors of the turns of a mapped way against the measured ones, bin after bin. The body's heading strays about the
/// mapped track's without going away from it (hunting, errors of the map), the sensor's turning adds up and has a
/// constant error; so the error of a bin is foretold from those before it (a Kalman filter of one state), and what is
/// not foretold counts. Bins may be added in the order of the way or against it.
struct TurnSum {
  double heading_rad = 0;  // of the body against the mapped track, after the last bin
  double heading_variance = 0;
  double heading_of_bias = 0;  // how much more it is for a constant error of one radian a bin
  double squared = 0;          // sum of the squared errors in sigmas, each at most kMostSquared
  double misfit = 0;           // ... at most kMostMisfit
  double log_variance = 0;
  double variance = 1;      // product of those not yet in log_variance
  double bias_squared = 0;  // with the constant error b the sum is squared - 2 b bias_error + b^2 bias_squared
  double bias_error = 0;
};

/// Tracks within that of each other, in about the same direction, lie beside each other.
inline constexpr double kBesideM = 40.0;
inline constexpr double kParallelRad = 0.3;

/// A place or way whose log likelihood is so far below the best one is given up.
inline constexpr double kFarBelow = 30.0;

/// How well turns and landmarks of a mapped way fit the measured ones.
class TurnModel {
 public:
  static constexpr double kMostSquared = 25.0;
  static constexpr double kMostMisfit = 9.0;
  TurnModel(const LocatorParameters& parameters, const MeasuredWay& way);

  /// Of no bins yet.
  [[nodiscard]] TurnSum begin() const {
    TurnSum sum;
    sum.heading_variance = heading_squared_;
    return sum;
  }
  /// The mapped turn of bin i. Where the place is only known to rough_m, the error may be as large as the curvature
  /// changes there.
  void add(TurnSum& sum, size_t i, double turn_rad, double rough_m) const {
    const double share = parameters_.curvature_share * turn_rad;
    const double change = rough_m > 0 ? change_rad(i, rough_m) : 0.0;
    const double heading = sum.heading_variance;
    const double variance = fresh_ + strayed_ * strayed_ * heading + variance_[i] + share * share;
    const double wide = variance + change * change;
    const double weight = 1 / wide;
    const double error = way_[i].turn_rad - turn_rad + strayed_ * sum.heading_rad;
    const double of_bias = 1 + strayed_ * sum.heading_of_bias;
    const double gain = (fresh_ - stays_ * strayed_ * heading) * weight;
    sum.heading_rad = stays_ * sum.heading_rad + gain * error;
    sum.heading_of_bias = stays_ * sum.heading_of_bias + gain * of_bias;
    sum.heading_variance = stays_ * stays_ * heading + fresh_ - gain * gain * wide;
    const double squared = error * error * weight;
    sum.misfit += std::min(squared, kMostMisfit);
    sum.variance *= variance * per_least_variance_;
    if (sum.variance > kLargeProduct) {
      sum.log_variance += std::log(sum.variance);
      sum.variance = 1;
    }
    sum.squared += std::min(squared, kMostSquared);
    if (squared > kMostSquared) return;
    sum.bias_squared += of_bias * of_bias * weight;
    sum.bias_error += of_bias * error * weight;
  }
  /// Log likelihood with the constant error that fits best.
  [[nodiscard]] double log_of(const TurnSum& sum) const {
    return -0.5 * (squared_of(sum) + sum.log_variance + std::log(sum.variance)) / parameters_.correlated_bins;
  }
  /// With the constant error that fits best; grows with every bin.
  [[nodiscard]] double squared_of(const TurnSum& sum) const { return sum.squared - by_bias(sum); }
  /// Mean of the squared errors in sigmas of all bins.
  [[nodiscard]] double misfit_of(const TurnSum& sum) const {
    return std::max(0.0, sum.misfit - by_bias(sum)) / static_cast<double>(way_.size());
  }
  /// Sum of the squares from which on the log likelihood is below least_log, whatever else.
  [[nodiscard]] double most_squared(double least_log) const {
    return -2 * parameters_.correlated_bins * least_log - least_log_variance_;
  }
  /// Likelihood of a sighted landmark: begins with that of a false one, and each mapped one adds to it. The place is
  /// known to rough_m.
  [[nodiscard]] double of_false_mark() const { return parameters_.false_per_m; }
  [[nodiscard]] double of_mark(double off_m, double rough_m) const { return parameters_.mark_density(off_m, rough_m); }
  [[nodiscard]] const MeasuredWay& way() const { return way_; }
  [[nodiscard]] const LocatorParameters& parameters() const { return parameters_; }

 private:
  static constexpr double kLargeProduct = 1e200;
  static constexpr size_t kMostBins = 4;
  [[nodiscard]] double by_bias(const TurnSum& sum) const {
    return sum.bias_error * sum.bias_error / (sum.bias_squared + per_bias_variance_);
  }
  /// How much the turn changes within rough_m of bin i.
  [[nodiscard]] double change_rad(size_t i, double rough_m) const {
    const double bins = std::min(rough_m / kBinM, static_cast<double>(kMostBins));
    const auto whole = static_cast<size_t>(bins);
    const double part = bins - static_cast<double>(whole);
    const double least = whole > 0 ? changes_rad_[whole - 1][i] : 0.0;
    return part > 0 ? least + part * (changes_rad_[whole][i] - least) : least;
  }
  LocatorParameters parameters_;
  const MeasuredWay& way_;
  std::array<std::vector<double>, kMostBins> changes_rad_;  // largest to one of the next 1, 2, ... bins
  std::vector<double> variance_;                            // of the turn of each bin, as measured
  double heading_squared_ = 0;
  double stays_ = 0;               // share of the heading's error after a bin
  double strayed_ = 0;             // ... and the rest
  double fresh_ = 0;               // variance that is new in a bin
  double per_least_variance_ = 0;  // of a bin
  double per_bias_variance_ = 0;
  double least_log_variance_ = 0;  // of the whole way
};

}  // namespace railfix::map_matcher
