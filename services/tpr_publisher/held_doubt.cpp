#include "tpr_publisher/held_doubt.hpp"

#include <algorithm>
#include <cmath>

#include "core/time.hpp"

namespace railfix::tpr_publisher {

namespace {

double speed_mps(const TrainPosition& position) {
  return position.standstill ? 0 : position.speed_mps;
}

}  // namespace

void HeldDoubt::follow(const TrainPosition& position, std::optional<double> foot_m, bool same_group, bool declared) {
  if (declared) {
    widest_over_m_ = widest_under_m_ = corrected_m_ = 0;
  } else if (same_group && last_ && foot_m && last_foot_m_) {
    const double run_m =
        0.5 * (speed_mps(*last_) + speed_mps(position)) * core::seconds(position.stamp_ns - last_->stamp_ns);
    if (std::isfinite(run_m)) corrected_m_ += *foot_m - *last_foot_m_ - run_m;
  }
  last_ = position;
  last_foot_m_ = foot_m;
  over_m_ = position.over_m;
  under_m_ = position.under_m;
  // What is no distance is not known, and stays so.
  if (over_m_ >= 0) widest_over_m_ = std::max(widest_over_m_, over_m_);
  if (under_m_ >= 0) widest_under_m_ = std::max(widest_under_m_, under_m_);
  if (declared) return;
  if (over_m_ >= 0) over_m_ = widest_over_m_ + std::max(corrected_m_, 0.0);
  if (under_m_ >= 0) under_m_ = widest_under_m_ + std::max(-corrected_m_, 0.0);
}

}  // namespace railfix::tpr_publisher
