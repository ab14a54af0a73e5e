#include "odometry/standstill.hpp"

#include <algorithm>
#include <cmath>

#include "core/time.hpp"

namespace railfix::odometry {
namespace {

constexpr int64_t kWindowNs = core::kNsPerSecond;
constexpr int64_t kShortNs = core::kNsPerSecond / 5;
constexpr double kFullShare = 0.75;  // of a window: pictures do not end where it does
// Of the band, over the whole short window: 0.01 m/s does not settle at the default.
constexpr double kSettledShare = 0.6;
// A trembling camera: the two halves of the long window agree. 0.003 m/s does not settle.
constexpr double kHalvesShare = 0.4;
constexpr double kTrembleBands = 6;
constexpr double kTrembleSigmas = 3;
constexpr double kLeftAtOnce = 10;  // bands in one picture
constexpr int kOutsideInARow = 3;

}  // namespace

bool Standstill::left(double measured_m) {
  const double away_m = std::abs(measured_m - anchor_m_);
  if (away_m > kLeftAtOnce * hold_m_) return true;
  const double tremble_m = recent_.spread(0, recent_.count()).rms_m;
  outside_ = away_m > std::max(hold_m_, kTrembleSigmas * tremble_m) ? outside_ + 1 : 0;
  const double lately_m = recent_.spread(recent_.since(kShortNs), recent_.count()).mean_m;
  return outside_ >= kOutsideInARow || std::abs(lately_m - anchor_m_) > hold_m_;
}

bool Standstill::settled(double measured_m) {
  const auto full = [this](size_t first, int64_t window_ns) {
    return recent_.count() - first >= 3 &&
           static_cast<double>(recent_.span_ns(first)) >= kFullShare * static_cast<double>(window_ns);
  };
  const size_t lately = recent_.since(kShortNs);
  const double share = static_cast<double>(recent_.span_ns(lately)) / static_cast<double>(kShortNs);
  if (full(lately, kShortNs) && recent_.spread(lately, recent_.count()).range_m < kSettledShare * share * hold_m_) {
    anchor_m_ = measured_m;
    return true;
  }
  if (!full(0, kWindowNs)) return false;
  const size_t middle = recent_.since(kWindowNs / 2);
  const auto all = recent_.spread(0, recent_.count());
  const double change_m = recent_.spread(middle, recent_.count()).mean_m - recent_.spread(0, middle).mean_m;
  if (all.range_m > kTrembleBands * hold_m_ || std::abs(change_m) > kHalvesShare * hold_m_) return false;
  anchor_m_ = all.mean_m;
  return true;
}

double Standstill::report(int64_t stamp_ns, double measured_m) {
  recent_.remember(stamp_ns, measured_m);
  if (resting_) {
    resting_ = !left(measured_m);
  } else {
    resting_ = settled(measured_m);
    outside_ = 0;
  }
  return resting_ ? anchor_m_ : measured_m;
}

double Standstill::recent_speed_mps() const {
  return resting_ ? 0 : recent_.speed_mps(kShortNs);
}

}  // namespace railfix::odometry
