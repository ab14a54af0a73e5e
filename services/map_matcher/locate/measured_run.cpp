#include "map_matcher/locate/measured_run.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

namespace railfix::map_matcher {
namespace {

constexpr double kRockingM = 5.0;   // shorter than a car: it stands on the same leg of every switch as before
constexpr double kMostBackM = 500;  // then the odometer may have slipped by more than can be laid together
constexpr double kSameMarkM = 1.5;  // balises of a group are further apart
constexpr double kOtherSigmas = 3.0;

}  // namespace

bool MeasuredRun::at_front() const {
  return back_m_ <= kRockingM;
}

void MeasuredRun::clear() {
  bins_.clear();
  gone_bins_ = 0;
  open_ = {};
  open_m_ = back_m_ = 0;
}

void MeasuredRun::move(double way_m, double turn_rad, double turn_sigma_rad) {
  const double variance = turn_sigma_rad * turn_sigma_rad;
  if (std::abs(way_m) > 2 * kBinM) {
    clear();  // a gap
  } else if (sign_ * way_m > 0) {
    lay(sign_ * way_m, turn_rad, variance);
  } else {
    take_back(-sign_ * way_m, turn_rad, variance);
  }
}

void MeasuredRun::lay(double way_m, double turn_rad, double variance) {
  back_m_ = std::max(0.0, back_m_ - way_m);
  open_.turn_rad += turn_rad;
  open_.variance += variance;
  open_m_ += way_m;
  while (open_m_ >= kBinM) {
    // What is too much belongs to the next bin, with its share of the turn.
    const double over_m = open_m_ - kBinM;
    const double share = std::min(1.0, over_m / way_m);
    MeasuredBin next;
    next.turn_rad = share * turn_rad;
    next.variance = std::min(share * variance, open_.variance);
    open_.turn_rad -= next.turn_rad;
    open_.variance -= next.variance;
    for (Mark mark : open_.marks) {
      if (mark.along_m < kBinM) continue;
      mark.along_m -= kBinM;
      next.marks.push_back(mark);
    }
    std::erase_if(open_.marks, [](const Mark& mark) { return mark.along_m >= kBinM; });
    bins_.push_back(std::move(open_));
    open_ = std::move(next);
    open_m_ = over_m;
  }
  while (static_cast<double>(bins_.size()) * kBinM > parameters_.window_m) {
    bins_.pop_front();
    ++gone_bins_;
  }
}

// Turned forth and back over the same way is not turned. What is left over is noise, or another leg of a switch.
void MeasuredRun::take_back(double way_m, double turn_rad, double variance) {
  back_m_ += way_m;
  open_m_ -= way_m;
  const double beyond = way_m > 0 ? std::clamp(-open_m_ / way_m, 0.0, 1.0) : 0.0;
  open_.turn_rad += (1 - beyond) * turn_rad;
  open_.variance += variance;
  if (open_m_ < 0 && (bins_.empty() || back_m_ > kMostBackM || elsewhere(open_.turn_rad))) {
    clear();
    return;
  }
  open_.turn_rad += beyond * turn_rad;
  while (open_m_ < 0 && !bins_.empty()) {
    MeasuredBin last = std::move(bins_.back());
    bins_.pop_back();
    last.turn_rad += open_.turn_rad;
    last.variance += open_.variance;
    open_ = std::move(last);  // landmarks further on are sighted again
    open_m_ += kBinM;
  }
  open_m_ = std::max(0.0, open_m_);
}

bool MeasuredRun::elsewhere(double turn_rad) const {
  return std::abs(turn_rad) > kOtherSigmas * std::hypot(parameters_.heading_sigma_rad, std::sqrt(open_.variance));
}

void MeasuredRun::sight(const Sighting& sighting) {
  Mark mark{open_m() + sign_ * sighting.distance_ahead_m, mark_kind(sighting.kind), sign_ * sighting.lateral_m};
  MeasuredBin* bin = &open_;
  for (auto before = bins_.rbegin(); mark.along_m < 0 && before != bins_.rend(); ++before) {
    bin = &*before;
    mark.along_m += kBinM;
  }
  if (mark.along_m < 0) return;
  const bool known = std::any_of(bin->marks.begin(), bin->marks.end(), [&](const Mark& other) {
    return alike(mark, other) && std::abs(mark.along_m - other.along_m) < kSameMarkM;
  });
  if (!known) bin->marks.push_back(mark);
}

}  // namespace railfix::map_matcher
