// Along the walls: where they leave the picture, and where the brightness steps on them.
#include <algorithm>
#include <cmath>

#include "track_detector/edge_tracker.hpp"

namespace railfix::track_detector {
namespace {

// Of the widest bearing: looks from farther away show the end of a wall too narrow.
constexpr double kStepWideShare = 0.65;
constexpr int kFewestStepLooks = 3;
constexpr double kStepM = 0.008;  // half a column of a look at 5 m
constexpr double kStepTopM = 0.06;
constexpr double kBesideStep = 0.8;  // of a step is beside it
constexpr double kClearStep = 3.5;   // grey levels; noise alone comes to 1
constexpr double kHalfShare = 0.7;   // of a step that half of the rows show: their noise is so much larger

}  // namespace

double EdgeTracker::leaves_ahead_m(double lateral_m) const {
  return widest_ > 0 ? std::abs(lateral_m) / widest_ : 0.0;
}

std::optional<LookAt> EdgeTracker::last_look_at(double place_m, double lateral_m) const {
  const double leaves_m = leaves_ahead_m(lateral_m);
  for (size_t i = 0; i < count_; ++i) {
    const Look& look = look_back(i);
    if (place_m - look.way_m >= leaves_m) return LookAt{look.way_m, look.stamp_ns};
  }
  return std::nullopt;
}

// Mean over the near looks, in grey levels, of how much the brightness steps at a place on a wall.
double EdgeTracker::step_at(double place_m, double wall_m, Rows rows) const {
  const Look& now = looks_[newest_];
  const double k = now.curvature_per_m;
  const double ahead_m = place_m - now.way_m;
  const double y_m = wall_m + 0.5 * k * ahead_m * ahead_m - now.eye_lateral_m;
  const double x_m = ahead_m - wall_m * k * ahead_m;
  double sum = 0;
  std::array<double, 2> half_sum{};
  int n = 0;
  for (const Relative& relative : relatives_) {
    if (ahead_m + relative.back_m < 1) continue;
    const double at = bearing_of(relative, x_m, y_m, 0);
    if (std::abs(at) > widest_) continue;
    if (std::abs(at) < kStepWideShare * widest_) break;
    const double column = at / cell_ + middle_;
    const auto below = static_cast<size_t>(column);
    if (column < 0 || below + 1 >= relative.look->step.size()) continue;
    const double part = column - static_cast<double>(below);
    const auto of = [&](const std::vector<float>& step) {
      return (1 - part) * static_cast<double>(step[below]) + part * static_cast<double>(step[below + 1]);
    };
    sum += of(relative.look->step);
    for (size_t i = 0; i < 2; ++i) half_sum[i] += of(relative.look->half_step[i]);
    ++n;
  }
  if (n < kFewestStepLooks) return 0.0;
  const double half = kHalfShare * std::max(std::abs(half_sum[0]), std::abs(half_sum[1]));
  return (rows == Rows::all ? std::abs(sum) : half) / n;
}

WallSteps EdgeTracker::steps(double wall_m, double from_m, double to_m, Rows rows) const {
  WallSteps found;
  if (count_ == 0) return found;
  const auto keep = [&](double top_m) {
    if (top_m > from_m + kStepTopM && top_m < to_m - kStepTopM && found.count < found.place_m.size())
      found.place_m[found.count++] = top_m;
  };
  double best = 0;
  double best_m = 0;
  double least = 0;  // since the last top
  for (double place_m = to_m; place_m > from_m; place_m -= kStepM) {
    const double step = step_at(place_m, wall_m, rows);
    if (step > std::max(best, kClearStep) && kBesideStep * step > least) {
      best = step;
      best_m = place_m;
    } else if (step < kBesideStep * best) {
      keep(best_m);
      best = 0;
      least = step;
    } else if (best == 0) {
      least = std::min(least, step);
    }
  }
  if (best > 0) keep(best_m);
  return found;
}

}  // namespace railfix::track_detector
