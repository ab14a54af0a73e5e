#include "map_matcher/shape/curve_exit_matcher.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

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
  std::optional<double> begin_m;
  double bent_m = 0;  // the last place that bends
  for (double m = path_->begin_m(); m < path_->end_m(); m += parameters_.bin_m) {
    if (std::abs(path_->curvature_at(m)) > parameters_.straight_per_m) {
      if (!begin_m) begin_m = m;
      bent_m = m;
    }
    if (!begin_m || (m - bent_m < parameters_.least_straight_m && m - *begin_m < kLongestCurveM)) continue;
    add_curve(*begin_m, bent_m + parameters_.bin_m);
    begin_m.reset();
  }
}

void CurveExitMatcher::add_curve(double begin_m, double exit_m) {
  Curve curve{begin_m, exit_m, {}, 0};
  double turn_rad = 0;
  for (double back_m = 0; back_m <= exit_m - begin_m; back_m += parameters_.bin_m) {
    curve.shape.push_back(path_->curvature_at(exit_m - back_m));
    curve.squared += curve.shape.back() * curve.shape.back();
    turn_rad += parameters_.bin_m * std::abs(curve.shape.back());
  }
  if (turn_rad > parameters_.least_turn_rad) curves_.push_back(std::move(curve));
}

void CurveExitMatcher::add(double odometer_m, double curvature_per_m, CurvatureOf of) {
  if (!std::isfinite(curvature_per_m)) return;
  if (of == CurvatureOf::body) odometer_m -= lag_m();
  if (bins_.empty()) bins_.push_back({odometer_m, curvature_per_m, 0, of});
  // Where the rails told the shape, the body comes by a lag later.
  if (odometer_m < bins_.back().odometer_m) return;
  // Bins without a measurement of their own are there too: the shape is compared bin by bin.
  while (odometer_m - bins_.back().odometer_m >= parameters_.bin_m) {
    bins_.push_back({bins_.back().odometer_m + parameters_.bin_m, curvature_per_m, 0, of});
  }
  while (odometer_m - bins_.front().odometer_m > kLongestCurveM) bins_.pop_front();
  has_new_ = true;
  Bin& bin = bins_.back();
  bin.curvature_per_m += (curvature_per_m - bin.curvature_per_m) / ++bin.count;
}

void CurveExitMatcher::forget() {
  bins_.clear();
  anchors_.clear();
  wait_for(next_);
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
  if (!std::exchange(has_new_, false)) return std::nullopt;  // stands, or runs back
  const double first_m = prior.path_distance_m - prior.over_m - parameters_.search_margin_m;
  const double last_m = prior.path_distance_m + prior.under_m + parameters_.search_margin_m;
  while (next_ < curves_.size() && curves_[next_].exit_m + lag_m() < first_m) wait_for(next_ + 1);
  if (next_ >= curves_.size() || bins_.empty() || curves_[next_].exit_m > last_m) return std::nullopt;
  const auto now = error(curves_[next_]);
  if (!now) return std::nullopt;
  most_before_ = std::max(most_before_, *now);
  if (*now < least_error_) {
    least_error_ = *now;
    least_at_m_ = bins_.back().odometer_m + 0.5 * parameters_.bin_m;
    fallen_ = most_before_ > parameters_.rise * *now;
  }
  const double reached_m = bins_.back().odometer_m + 0.5 * parameters_.bin_m;
  const bool past = *now > parameters_.rise * least_error_ || reached_m - least_at_m_ > parameters_.rise_m;
  if (least_error_ > parameters_.most_error || !fallen_ || !past) return std::nullopt;
  const bool of_body = any_of_body(curves_[next_]);
  add_anchors(curves_[next_]);
  wait_for(next_ + 1);
  const double open_m = of_body ? open_lag_m() : 0.0;
  if (open_m > 0 && std::min(prior.over_m, prior.under_m) < open_m) return std::nullopt;
  const double sigma_m = std::hypot(parameters_.sigma_m, open_m / std::sqrt(12.0));
  return Fix{stamp_ns, corrected_m(odometer_m), sigma_m, 0.95, 0};
}

void CurveExitMatcher::add_anchors(const Curve& curve) {
  // A curve that is recognised a little too early does not reach back into the one before.
  const double after_m = anchors_.empty() ? -INFINITY : anchors_.back().odometer_m;
  anchors_.push_back({std::max(least_at_m_ - (curve.exit_m - curve.begin_m), after_m), curve.begin_m});
  anchors_.push_back({std::max(least_at_m_, after_m), curve.exit_m});
}

bool CurveExitMatcher::any_of_body(const Curve& curve) const {
  return std::any_of(bins_.end() - static_cast<ptrdiff_t>(curve.shape.size()), bins_.end(),
                     [](const Bin& bin) { return bin.of == CurvatureOf::body; });
}

void CurveExitMatcher::wait_for(size_t curve) {
  next_ = curve;
  least_error_ = 1;
  most_before_ = 0;
  fallen_ = false;
}

double CurveExitMatcher::corrected_m(double odometer_m) const {
  if (anchors_.empty()) return odometer_m;
  const auto mapped = [&](const Anchor& a, const Anchor& b, const Anchor& from) {
    const double slope = (b.place_m - a.place_m) / std::max(b.odometer_m - a.odometer_m, 1.0);
    return from.place_m + std::clamp(slope, 1 - kMostScale, 1 + kMostScale) * (odometer_m - from.odometer_m);
  };
  const auto after = std::upper_bound(anchors_.begin(), anchors_.end(), odometer_m,
                                      [](double m, const Anchor& anchor) { return m < anchor.odometer_m; });
  if (after != anchors_.begin() && after != anchors_.end()) return mapped(*(after - 1), *after, *(after - 1));
  // Before the first and behind the last: entries (even) and exits (odd) of one curve are as far apart as on the map,
  // whatever the scale, so those of two curves tell it.
  const bool is_before = after == anchors_.begin();
  const size_t nearest = is_before ? 0 : anchors_.size() - 1;
  if (anchors_.size() < 4) return anchors_[nearest].place_m + odometer_m - anchors_[nearest].odometer_m;
  const size_t first = is_before ? 0 : nearest - 2;
  return mapped(anchors_[first], anchors_[first + 2], anchors_[nearest]);
}

}  // namespace railfix::map_matcher
