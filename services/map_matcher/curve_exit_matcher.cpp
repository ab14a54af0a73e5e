#include "map_matcher/curve_exit_matcher.hpp"

#include <algorithm>
#include <cmath>

namespace railfix::map_matcher {
namespace {

constexpr double kLongestCurveM = 3000;
constexpr double kMostScale = 0.03;

}  // namespace

CurveExitMatcher::CurveExitMatcher(const CurveExitParameters& parameters, std::shared_ptr<const track::Path> path)
    : parameters_(parameters), path_(std::move(path)) {
  find_curves();
}

void CurveExitMatcher::find_curves() {
  const double step_m = parameters_.bin_m;
  std::optional<double> begin_m;
  double turn_rad = 0;
  for (double m = path_->begin_m(); m < path_->end_m(); m += step_m) {
    const double curvature = path_->curvature_at(m);
    const bool bends = std::abs(curvature) > parameters_.straight_per_m;
    if (bends && !begin_m) {
      begin_m = m;
      turn_rad = 0;
    }
    if (begin_m) turn_rad += step_m * std::abs(curvature);
    const bool ends = begin_m && (!bends || m - *begin_m > kLongestCurveM);
    if (!ends) continue;
    if (turn_rad > parameters_.least_turn_rad) {
      Curve curve{*begin_m, m, {}, 0};
      for (double back_m = 0; back_m <= m - *begin_m; back_m += step_m) {
        curve.shape.push_back(path_->curvature_at(m - back_m));
        curve.squared += curve.shape.back() * curve.shape.back();
      }
      curves_.push_back(std::move(curve));
    }
    begin_m.reset();
  }
}

void CurveExitMatcher::add(double odometer_m, double curvature_per_m) {
  if (!std::isfinite(curvature_per_m)) return;
  if (bins_.empty()) bins_.push_back({odometer_m, curvature_per_m, 1});
  // Bins without a measurement of their own are there too: the shape is compared bin by bin.
  while (odometer_m - bins_.back().odometer_m >= parameters_.bin_m) {
    bins_.push_back({bins_.back().odometer_m + parameters_.bin_m, curvature_per_m, 0});
  }
  while (odometer_m - bins_.front().odometer_m > kLongestCurveM) bins_.pop_front();
  Bin& bin = bins_.back();
  bin.curvature_per_m += (curvature_per_m - bin.curvature_per_m) / ++bin.count;
}

// Equations 49 and 51, the curve's exit laid on the newest measurement.
std::optional<double> CurveExitMatcher::error(const Curve& curve) const {
  if (bins_.size() < curve.shape.size()) return std::nullopt;
  double sum = 0;
  for (size_t i = 0; i < curve.shape.size(); ++i) {
    const double off = bins_[bins_.size() - 1 - i].curvature_per_m - curve.shape[i];
    sum += off * off;
  }
  return sum / curve.squared;
}

std::optional<Fix> CurveExitMatcher::match(int64_t stamp_ns, double odometer_m, const Prior& prior) {
  const double first_m = prior.path_distance_m - prior.over_m - parameters_.search_margin_m;
  const double last_m = prior.path_distance_m + prior.under_m + parameters_.search_margin_m;
  while (next_ < curves_.size() && curves_[next_].exit_m < first_m) wait_for(next_ + 1);
  if (next_ >= curves_.size() || bins_.empty() || curves_[next_].exit_m > last_m) return std::nullopt;
  const auto now = error(curves_[next_]);
  if (!now) return std::nullopt;
  most_before_ = std::max(most_before_, *now);
  if (*now < least_error_) {
    least_error_ = *now;
    least_at_m_ = bins_.back().odometer_m + 0.5 * parameters_.bin_m;
    fallen_ = most_before_ > parameters_.rise * *now;
  }
  const bool past = *now > parameters_.rise * least_error_ || odometer_m - least_at_m_ > parameters_.rise_m;
  if (least_error_ > parameters_.most_error || !fallen_ || !past) return std::nullopt;
  anchors_.push_back({least_at_m_, curves_[next_].exit_m});
  wait_for(next_ + 1);
  return Fix{stamp_ns, anchors_.back().place_m + odometer_m - anchors_.back().odometer_m, parameters_.sigma_m, 0.95, 0};
}

void CurveExitMatcher::wait_for(size_t curve) {
  next_ = curve;
  least_error_ = 1;
  most_before_ = 0;
  fallen_ = false;
}

double CurveExitMatcher::corrected_m(double odometer_m) const {
  if (anchors_.empty()) return odometer_m;
  if (anchors_.size() == 1) return anchors_[0].place_m + odometer_m - anchors_[0].odometer_m;
  const auto after = std::upper_bound(anchors_.begin() + 1, anchors_.end() - 1, odometer_m,
                                      [](double m, const Anchor& anchor) { return m < anchor.odometer_m; });
  const Anchor& a = *(after - 1);
  const Anchor& b = *after;
  const double slope =
      std::clamp((b.place_m - a.place_m) / std::max(b.odometer_m - a.odometer_m, 1.0), 1 - kMostScale, 1 + kMostScale);
  const Anchor& from = odometer_m > b.odometer_m ? b : a;
  return from.place_m + slope * (odometer_m - from.odometer_m);
}

}  // namespace railfix::map_matcher
