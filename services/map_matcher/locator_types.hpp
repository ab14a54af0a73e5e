// What the parts of the search on the whole network share: parameters, the measured way, and how well a turn fits.
#pragma once

#include <algorithm>
#include <array>
#include <vector>

#include "track/ways.hpp"

namespace railfix::map_matcher {

struct LocatorParameters {
  double window_m = 6000;         // longest way that is searched for
  double least_way_m = 800;       // shorter ways are not searched for
  double least_turn_rad = 0.4;    // nor ways that bend less (sum of the turns, left and right)
  double scale_range = 0.02;      // of the odometer
  double noise_per_m = 3e-4;      // least sigma of the curvature over 20 m: body, map
  double curvature_share = 0.05;  // of the mapped curvature
  double correlated_bins = 3.0;   // neighbouring bins err together
  double lag_m = 20.0;            // the body's heading is the mean of the track's over so much behind the foot
  double detection = 0.8;         // chance that a mapped balise is sighted
  double false_per_m = 0.0005;
  double certain = 0.9999;        // probability from which on the place is certain ...
  double certain_misfit = 1.3;    // ... when the bins fit to so many sigmas squared in the mean ...
  double certain_sigma_m = 20.0;  // ... and the place along the track to this sigma
};

/// 20 m of the measured way.
struct MeasuredBin {
  double turn_rad = 0;
  double variance = 0;
  std::vector<double> balises_m;  // sighted, from the bin's beginning
};
constexpr double kBinM = 20.0;
using MeasuredWay = std::vector<MeasuredBin>;  // oldest first

/// A place that may be the one: where bin `bin` begins.
struct Candidate {
  track::Run run;
  double into_m = 0;
  size_t bin = 0;
  double scale = 1;    // true over measured metres, as good as known
  double squared = 0;  // errors of the coarse search
};

/// How well turns and balises of a mapped way fit the measured ones.
class TurnModel {
 public:
  TurnModel(const LocatorParameters& parameters, const MeasuredWay& way);
  /// Of a turn for bin i: the error in sigmas, and the variance in least ones. Where the place is only known to
  /// rough_m, the error may be as large as the curvature changes there.
  struct Error {
    double squared = 0;
    double variance = 1;
  };
  [[nodiscard]] Error of_turn(size_t i, double turn_rad, double rough_m) const {
    const double share = parameters_.curvature_share * turn_rad;
    const double change = rough_m > 0 ? change_rad(i, rough_m) : 0.0;
    const double variance = variance_[i] + share * share + change * change;
    const double error = way_[i].turn_rad - turn_rad;
    return {error * error / variance, variance * per_least_variance_};
  }
  /// Log likelihood of one or several turns: their errors, each at most kMostSquared, and the product of the variances.
  static constexpr double kMostSquared = 25.0;
  [[nodiscard]] double log_of(double squared, double variance) const;
  /// Log likelihood of a sighted balise, with the distances to the mapped ones (of which some are near).
  template <typename Distances>
  [[nodiscard]] double of_balise(const Distances& distances_m) const {
    double density = parameters_.false_per_m;
    for (const double off_m : distances_m) density += of_distance(off_m);
    return of_density(density);
  }
  [[nodiscard]] const MeasuredWay& way() const { return way_; }
  [[nodiscard]] const LocatorParameters& parameters() const { return parameters_; }

 private:
  /// How much the turn changes within rough_m of bin i.
  [[nodiscard]] double change_rad(size_t i, double rough_m) const {
    const double bins = std::min(rough_m / kBinM, static_cast<double>(kMostBins));
    const auto whole = static_cast<size_t>(bins);
    const double part = bins - static_cast<double>(whole);
    const double least = whole > 0 ? changes_rad_[whole - 1][i] : 0.0;
    return part > 0 ? least + part * (changes_rad_[whole][i] - least) : least;
  }
  [[nodiscard]] double of_distance(double off_m) const;
  [[nodiscard]] static double of_density(double density);
  LocatorParameters parameters_;
  const MeasuredWay& way_;
  static constexpr size_t kMostBins = 4;
  std::array<std::vector<double>, kMostBins> changes_rad_;  // largest to one of the next 1, 2, ... bins
  std::vector<double> variance_;
  double per_least_variance_ = 0;
};

}  // namespace railfix::map_matcher
