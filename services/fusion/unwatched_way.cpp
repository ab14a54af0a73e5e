#include "fusion/unwatched_way.hpp"

#include <cmath>

namespace railfix::fusion {
namespace {

constexpr double kHiddenSlipMps = 0.7;
constexpr double kHiddenSlipShare = 0.07;  // of the speed

}  // namespace

// A slip that begins slowly takes the filter along, and when it ends it is the wheel that seems to slip.
void UnwatchedWay::count(const WheelCount& now, const FusionParameters& parameters) {
  const double run_m = now.distance_m - distance_m_;
  distance_m_ += run_m;
  auto& since = since_reference_;
  if (now.isolated && !now.watched) since.counted.add(now.scale * now.way_m - run_m);
  // Nobody else measures for a while, or the wheel came back on the word of an IMU: a slip may be no larger than what
  // passes for a change of speed.
  const double speed_mps = std::abs(now.speed_mps);
  const double alone_mps = changed_alone_mps(now.alone, speed_mps, parameters);
  if (now.watched && (now.alone || now.came_back)) {
    const double passes_mps = std::max(kHiddenSlipMps, kHiddenSlipShare * speed_mps);
    const double hidden_mps = std::max(passes_mps, alone_mps);
    const double more_m = std::min(hidden_mps * now.time_s, parameters.wheel_slip_share * std::abs(now.way_m));
    const double most_m = std::max(since.hidden_m, hidden_mps * parameters.wheel_slip_s);
    since.hidden_m = std::min(since.hidden_m + more_m, most_m);
  }
  since.way_m += now.unseen_share * std::max(std::abs(now.way_m), std::abs(run_m));
  since.fastest_mps = std::max(since.fastest_mps, now.unseen_share * speed_mps);
}

// So much a slip may have changed the speed that a wheel alone says: as a train accelerates or brakes, for as long.
double UnwatchedWay::changed_alone_mps(bool alone, double speed_mps, const FusionParameters& parameters) {
  if (!alone) alone_slowest_mps_ = alone_fastest_mps_ = speed_mps;
  alone_slowest_mps_ = std::min(alone_slowest_mps_, speed_mps);
  alone_fastest_mps_ = std::max(alone_fastest_mps_, speed_mps);
  return std::min(alone_fastest_mps_ - alone_slowest_mps_, parameters.wheel_slip_share * alone_fastest_mps_);
}

Sides UnwatchedWay::may_be_off(const FusionParameters& p) const {
  const auto& since = since_reference_;
  const double once_m = p.wheel_slip_share * std::min(since.way_m, since.fastest_mps * p.wheel_slip_s);
  const double slip_m = std::min(once_m + p.wheel_slip_per_m * since.way_m, p.wheel_slip_share * since.way_m);
  // A wheel that slides counts less than it is judged by.
  const double slide_m = slip_m / (1 - std::min(p.wheel_slip_share, 0.9));
  Sides off{slip_m + since.hidden_m, slide_m + since.hidden_m};
  for (const Apart& one : {since.counted, since.refused, since.felt}) off.add(one.most);
  return off;
}

}  // namespace railfix::fusion
