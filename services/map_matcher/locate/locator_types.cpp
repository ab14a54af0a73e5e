#include "map_matcher/locate/locator_types.hpp"

#include <algorithm>
#include <cmath>

namespace railfix::map_matcher {
namespace {

constexpr double kDetailM = 2.0;

}  // namespace

TurnModel::TurnModel(const LocatorParameters& parameters, const MeasuredWay& way) : parameters_(parameters), way_(way) {
  heading_squared_ = std::pow(parameters.heading_sigma_rad, 2);
  stays_ = std::exp(-kBinM / parameters.heading_m);
  strayed_ = 1 - stays_;
  fresh_ = heading_squared_ * (1 - stays_ * stays_);
  per_least_variance_ = 1 / fresh_;
  per_bias_variance_ = parameters.correlated_bins / std::pow(parameters.bias_per_m * kBinM, 2);
  for (size_t k = 0; k < kMostBins; ++k) {
    for (size_t i = 0; i < way.size(); ++i) {
      const double before = way[i - std::min(i, k + 1)].turn_rad;
      const double after = way[std::min(i + k + 1, way.size() - 1)].turn_rad;
      const double change = std::max(std::abs(way[i].turn_rad - before), std::abs(after - way[i].turn_rad));
      changes_rad_[k].push_back(std::max(change, k > 0 ? changes_rad_[k - 1][i] : 0.0));
    }
  }
  const double least = std::pow(parameters.noise_per_m * kBinM, 2);
  for (size_t i = 0; i < way.size(); ++i) {
    // Map and body do not tell where within a few metres a kink lies.
    const double detail = kDetailM / kBinM * changes_rad_[0][i];
    variance_.push_back(way[i].variance + least + detail * detail);
    least_log_variance_ += std::log((fresh_ + variance_.back()) * per_least_variance_);
  }
}

}  // namespace railfix::map_matcher
