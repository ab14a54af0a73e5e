#include "map_matcher/locator_types.hpp"

#include <algorithm>
#include <cmath>

namespace railfix::map_matcher {
namespace {

constexpr double kBaliseSigmaM = 4.0;

}  // namespace

TurnModel::TurnModel(const LocatorParameters& parameters, const MeasuredWay& way) : parameters_(parameters), way_(way) {
  const double least = std::pow(parameters_.noise_per_m * kBinM, 2);
  per_least_variance_ = 1 / least;
  for (const auto& bin : way) variance_.push_back(bin.variance + least);
  for (size_t k = 0; k < kMostBins; ++k) {
    for (size_t i = 0; i < way.size(); ++i) {
      const double before = way[i - std::min(i, k + 1)].turn_rad;
      const double after = way[std::min(i + k + 1, way.size() - 1)].turn_rad;
      const double change = std::max(std::abs(way[i].turn_rad - before), std::abs(after - way[i].turn_rad));
      changes_rad_[k].push_back(std::max(change, k > 0 ? changes_rad_[k - 1][i] : 0.0));
    }
  }
}

double TurnModel::log_of(double squared, double variance) const {
  return -0.5 * (squared + std::log(variance)) / parameters_.correlated_bins;
}

double TurnModel::of_distance(double off_m) const {
  const double z = off_m / kBaliseSigmaM;
  return std::abs(z) > 6 ? 0.0 : parameters_.detection * std::exp(-0.5 * z * z) / (kBaliseSigmaM * 2.5066);
}

double TurnModel::of_density(double density) {
  return std::log(std::min(density, 1.0));
}

}  // namespace railfix::map_matcher
