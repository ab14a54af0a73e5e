#include "map_matcher/shape/curvature_matcher.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "map_matcher/inputs.hpp"

namespace railfix::map_matcher {
namespace {

constexpr double kStepM = 1.0;
constexpr double kGridM = 1.0;
constexpr double kLagStepM = 2.5;
constexpr double kLagKnownShare = 0.7;  // of the sigma of a lag that nothing tells
constexpr size_t kFewestBins = 10;
constexpr double kLookShare = 0.02;  // of the window's length is the way between two searches of it
constexpr double kNextBin = 1.6;     // bins that lie no further apart have a place in common
constexpr double kBetterBy = 0.97;   // a sigma that shrinks less than this is as good as it gets
constexpr std::array<double, 5> kScales = {-1.5, -0.75, 0.0, 0.75, 1.5};  // in sigmas

}  // namespace

/// The map's curvature on a grid: the search asks for it some hundred thousand times.
class CurvatureMatcher::MapCurvature {
 public:
  MapCurvature(const track::Path& path, double from_m, double to_m) : from_m_(from_m) {
    for (double m = from_m; m <= to_m + 2 * kGridM; m += kGridM) values_.push_back(path.curvature_at(m));
  }
  [[nodiscard]] double at(double place_m) const {
    const double cell = std::clamp((place_m - from_m_) / kGridM, 0.0, static_cast<double>(values_.size() - 2));
    const auto i = static_cast<size_t>(cell);
    return values_[i] + (cell - static_cast<double>(i)) * (values_[i + 1] - values_[i]);
  }

 private:
  double from_m_;
  std::vector<double> values_;
};

void CurvatureMatcher::add(double odometer_m, double curvature_per_m, double sigma_per_m, CurvatureOf of) {
  add(odometer_m, curvature_per_m, sigma_per_m, of, 0);
}

void CurvatureMatcher::add(double odometer_m, const Turn& turn) {
  const double way_m = turn.way_m;
  add(odometer_m - 0.5 * way_m, turn.turn_rad / way_m, turn.sigma_rad / way_m, CurvatureOf::body,
      turn.bias_rad / way_m);
}

void CurvatureMatcher::add(double odometer_m, double curvature_per_m, double sigma_per_m, CurvatureOf of,
                           double gyro_per_m) {
  if (!std::isfinite(odometer_m) || !has_sense(ViewInput{curvature_per_m, sigma_per_m * sigma_per_m})) return;
  const Bin sample{odometer_m, curvature_per_m, 1 / (sigma_per_m * sigma_per_m), of, gyro_per_m};
  const auto cell = [this](const Bin& b) { return std::floor(b.odometer_m / parameters_.bin_m); };
  auto bin = std::find_if(bins_.rbegin(), bins_.rend(),
                          [&](const Bin& b) { return b.of == sample.of && cell(b) == cell(sample); });
  if (bin != bins_.rend()) {
    bin->add(sample);
    return;
  }
  bins_.push_back(sample);
  // A train that runs to and fro does not leave its window: as many as that has, of rails and of the body, are enough.
  const auto most_bins = static_cast<size_t>(2 * (parameters_.window_m / parameters_.bin_m + 1));
  while (bins_.size() > most_bins ||
         std::abs(bins_.back().odometer_m - bins_.front().odometer_m) > parameters_.window_m) {
    bins_.pop_front();
  }
}

void CurvatureMatcher::Bin::add(const Bin& sample) {
  const double part = sample.weight / (weight + sample.weight);
  odometer_m += part * (sample.odometer_m - odometer_m);
  curvature_per_m += part * (sample.curvature_per_m - curvature_per_m);
  gyro_per_m += part * (sample.gyro_per_m - gyro_per_m);
  weight += sample.weight;
}

/// Of the sway at the end of each bin of the body.
class CurvatureMatcher::SwayFilter {
 public:
  explicit SwayFilter(const CurvatureParameters& parameters)
      : bin_m_(parameters.bin_m),
        keeps_(std::exp(-parameters.bin_m / parameters.sway_m)),
        sway_(std::pow(parameters.sway_rad / parameters.bin_m, 2)) {}

  /// `noise`: variance of its curvature without any sway.
  Weighing weigh(const Bin& bin, double noise) {
    const double apart_m = before_ == nullptr ? 0 : bin.odometer_m - before_->odometer_m;
    const double way_before = std::exchange(way_, apart_m < 0 ? -1.0 : 1.0);
    const bool begins = before_ == nullptr || std::abs(apart_m) > kNextBin * bin_m_ || way_ != way_before;
    before_ = &bin;
    if (begins) {
      variance_ = sway_;
      bias_ = gyro_ = 0;
    }
    const double of_sway = keeps_ - 1;
    const double fresh = sway_ * (1 - keeps_ * keeps_);
    const double unexpected = noise + of_sway * of_sway * variance_ + fresh;
    const double together = keeps_ * of_sway * variance_ + fresh;
    const double gain = together / unexpected;
    const double of_bias = way_ - of_sway * bias_;
    const double of_gyro = way_ * bin.gyro_per_m - of_sway * gyro_;
    variance_ = keeps_ * keeps_ * variance_ + fresh - gain * together;
    bias_ = keeps_ * bias_ + gain * of_bias;
    gyro_ = keeps_ * gyro_ + gain * of_gyro;
    return {way_, of_sway, keeps_, gain, 1 / unexpected, of_bias, of_gyro, begins};
  }

 private:
  double bin_m_;
  double keeps_;
  double sway_;  // its variance, in bins' curvature
  const Bin* before_ = nullptr;
  double way_ = 1;
  double variance_ = 0;  // of the sway that is estimated
  double bias_ = 0;      // what a constant error of 1 makes of that ...
  double gyro_ = 0;      // ... and one sigma of the gyro's
};

CurvatureMatcher::Weighings CurvatureMatcher::weighings() const {
  SwayFilter filter(parameters_);
  Weighings all;
  all.bins.reserve(bins_.size());
  double bias = 1 / (parameters_.bias_per_m * parameters_.bias_per_m);
  double both = 0;
  double gyro = 1;
  for (const Bin& bin : bins_) {
    const double noise = 1 / bin.weight + parameters_.noise_per_m * parameters_.noise_per_m;
    const Weighing as = bin.of == CurvatureOf::body ? filter.weigh(bin, noise) : Weighing{.weight = 1 / noise};
    bias += as.weight * as.of_bias * as.of_bias;
    both += as.weight * as.of_bias * as.of_gyro;
    gyro += as.weight * as.of_gyro * as.of_gyro;
    all.bins.push_back(as);
  }
  const double determinant = bias * gyro - both * both;
  all.bias = gyro / determinant;
  all.both = -both / determinant;
  all.gyro = bias / determinant;
  return all;
}

double CurvatureMatcher::misfit(const MapCurvature& map, const Weighings& weighings, double place_m, double scale,
                                double lag_m, double odometer_m) const {
  double sum = 0;
  double bias = 0;
  double gyro = 0;
  double sway = 0;
  for (size_t i = 0; i < bins_.size(); ++i) {
    const Bin& bin = bins_[i];
    const Weighing& as = weighings.bins[i];
    const double of_m = place_m - (bin.of == CurvatureOf::body ? lag_m : 0.0);
    double error = as.way * (bin.curvature_per_m - map.at(of_m + (1 + scale) * (bin.odometer_m - odometer_m)));
    if (as.begins) sway = 0;
    error -= as.of_sway * sway;
    sway = as.keeps * sway + as.gain * error;
    sum += as.weight * error * error;
    bias += as.weight * as.of_bias * error;
    gyro += as.weight * as.of_gyro * error;
  }
  // What is left when both constant errors take the values that fit best.
  return sum - weighings.bias * bias * bias - 2 * weighings.both * bias * gyro - weighings.gyro * gyro * gyro;
}

bool CurvatureMatcher::any_of_body() const {
  return std::any_of(bins_.begin(), bins_.end(), [](const Bin& bin) { return bin.of == CurvatureOf::body; });
}

size_t CurvatureMatcher::Window::places() const {
  return static_cast<size_t>((to_m - from_m) / kStepM) + 1;
}

double CurvatureMatcher::Window::offset_m(size_t place) const {
  return from_m + kStepM * static_cast<double>(place);
}

CurvatureMatcher::Peak CurvatureMatcher::search(double odometer_m, const Prior& prior) const {
  const Window window{-prior.over_m - parameters_.search_margin_m, prior.under_m + parameters_.search_margin_m};
  return peak_of(likelihoods(misfits(window, odometer_m, prior.path_distance_m), window.places()), window);
}

std::vector<double> CurvatureMatcher::misfits(const Window& window, double odometer_m, double expected_m) const {
  const auto [nearest, farthest] = std::minmax_element(
      bins_.begin(), bins_.end(), [](const Bin& a, const Bin& b) { return a.odometer_m < b.odometer_m; });
  const double stretch = 1 + 2 * parameters_.scale_sigma;
  const MapCurvature map(
      *path_,
      expected_m + window.from_m - parameters_.lag_m + stretch * std::min(0.0, nearest->odometer_m - odometer_m),
      expected_m + window.to_m + stretch * std::max(0.0, farthest->odometer_m - odometer_m));
  const size_t lags = any_of_body() ? static_cast<size_t>(std::ceil(parameters_.lag_m / kLagStepM)) + 1 : 1;
  const double lag_step_m = lags > 1 ? parameters_.lag_m / static_cast<double>(lags - 1) : 0.0;
  const auto weighed = weighings();
  std::vector<double> all;
  all.reserve(window.places() * lags * kScales.size());
  for (size_t place = 0; place < window.places(); ++place) {
    for (size_t lag = 0; lag < lags; ++lag) {
      for (const double scale : kScales)
        all.push_back(misfit(map, weighed, expected_m + window.offset_m(place), parameters_.scale_sigma * scale,
                             lag_step_m * static_cast<double>(lag), odometer_m));
    }
  }
  return all;
}

// The odometer's scale and the body's lag are summed over. A fit worse than the noise says that noise or map are worse
// than assumed.
std::vector<double> CurvatureMatcher::likelihoods(const std::vector<double>& misfits, size_t places) const {
  const double best = *std::min_element(misfits.begin(), misfits.end());
  const double worse = std::max(1.0, best / static_cast<double>(bins_.size()));
  std::vector<double> likelihood(places);
  for (size_t i = 0; i < misfits.size(); ++i) {
    const double scale = kScales[i % kScales.size()];
    likelihood[i / (misfits.size() / places)] +=
        std::exp(-0.5 * (misfits[i] - best) / (worse * parameters_.correlated_bins) - 0.5 * scale * scale);
  }
  return likelihood;
}

CurvatureMatcher::Peak CurvatureMatcher::peak_of(const std::vector<double>& likelihood, const Window& window) const {
  const auto top = static_cast<size_t>(std::max_element(likelihood.begin(), likelihood.end()) - likelihood.begin());
  const double top_m = window.offset_m(top);
  double sum = 0;
  double mass = 0;
  double mean = 0;
  double square = 0;
  for (size_t i = 0; i < likelihood.size(); ++i) {
    sum += likelihood[i];
    const double off_m = window.offset_m(i) - top_m;
    if (std::abs(off_m) > 3 * parameters_.max_sigma_m) continue;
    mass += likelihood[i];
    mean += likelihood[i] * off_m;
    square += likelihood[i] * off_m * off_m;
  }
  mean /= mass;
  const double variance = std::max(square / mass - mean * mean, 0.0) + kStepM * kStepM / 12;
  const bool at_edge = top_m - window.from_m < 2 * kStepM || window.to_m - top_m < 2 * kStepM;
  return {top_m + mean, std::sqrt(variance), mass / sum, at_edge};
}

std::optional<Fix> CurvatureMatcher::match(int64_t stamp_ns, double odometer_m, const Prior& prior) {
  if (bins_.size() < kFewestBins || !prior.usable()) return std::nullopt;
  // A search of 2 km takes 50 ms.
  if (looked_m_ && std::abs(odometer_m - *looked_m_) < kLookShare * (prior.over_m + prior.under_m)) return std::nullopt;
  looked_m_ = odometer_m;
  const Peak peak = search(odometer_m, prior);
  const double sigma_m = std::hypot(peak.sigma_m, parameters_.sigma_floor_m);
  if (peak.at_edge || sigma_m > parameters_.max_sigma_m || peak.probability < parameters_.min_probability) {
    waiting_sigma_m_ = 0;
    return std::nullopt;
  }
  // An unknown lag is the same error in every fix: more of them must not make the place surer than it.
  const bool lag_unknown = any_of_body() && peak.sigma_m > kLagKnownShare * parameters_.lag_m / std::sqrt(12.0);
  if (lag_unknown && std::min(prior.over_m, prior.under_m) < parameters_.lag_m) return std::nullopt;
  if (waiting_sigma_m_ == 0 || sigma_m < kBetterBy * waiting_sigma_m_) {
    waiting_sigma_m_ = sigma_m;
    return std::nullopt;
  }
  forget();
  return Fix{stamp_ns, prior.path_distance_m + peak.offset_m, sigma_m, peak.probability, 0};
}

}  // namespace railfix::map_matcher
