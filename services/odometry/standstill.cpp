#include "odometry/standstill.hpp"

#include <algorithm>
#include <cmath>

#include "core/time.hpp"

namespace railfix::odometry {
namespace {

constexpr int64_t kWindowNs = core::kNsPerSecond;
constexpr int64_t kShortNs = core::kNsPerSecond / 5;
constexpr double kFullShare = 0.75;    // of a window: pictures do not end where it does
constexpr double kSettledShare = 0.6;  // of the band, over the short window: 0.01 m/s does not settle at the default
// A trembling camera: the two halves of the long window agree. 0.003 m/s does not settle.
constexpr double kHalvesShare = 0.4;
constexpr double kTrembleBands = 6;
constexpr double kTrembleSigmas = 3;
constexpr double kLeftAtOnce = 10;  // bands in one picture
constexpr int kOutsideInARow = 3;

}  // namespace

void Standstill::remember(int64_t stamp_ns, double measured_m) {
  if (recent_.size() == kMostRecent) recent_.erase(recent_.begin());
  recent_.push_back({stamp_ns, measured_m});
  recent_.erase(recent_.begin(), recent_.begin() + static_cast<std::ptrdiff_t>(since(kWindowNs)));
}

size_t Standstill::since(int64_t age_ns) const {
  size_t first = 0;
  while (recent_.back().stamp_ns - recent_[first].stamp_ns > age_ns) ++first;
  return first;
}

Standstill::Spread Standstill::spread(size_t first, size_t end) const {
  const auto count = static_cast<double>(end - first);
  double sum = 0;
  double low_m = recent_[first].measured_m;
  double high_m = low_m;
  for (size_t i = first; i < end; ++i) {
    sum += recent_[i].measured_m;
    low_m = std::min(low_m, recent_[i].measured_m);
    high_m = std::max(high_m, recent_[i].measured_m);
  }
  Spread spread{sum / count, 0, high_m - low_m};
  double squares = 0;
  for (size_t i = first; i < end; ++i) squares += std::pow(recent_[i].measured_m - spread.mean, 2);
  spread.rms = std::sqrt(squares / count);
  return spread;
}

bool Standstill::left(double measured_m) {
  const double away_m = std::abs(measured_m - anchor_m_);
  if (away_m > kLeftAtOnce * hold_m_) return true;
  const double tremble_m = spread(0, recent_.size()).rms;
  outside_ = away_m > std::max(hold_m_, kTrembleSigmas * tremble_m) ? outside_ + 1 : 0;
  const double lately_m = spread(since(kShortNs), recent_.size()).mean;
  return outside_ >= kOutsideInARow || std::abs(lately_m - anchor_m_) > hold_m_;
}

bool Standstill::settled() {
  const auto full = [this](size_t first, int64_t window_ns) {
    const auto span_ns = static_cast<double>(recent_.back().stamp_ns - recent_[first].stamp_ns);
    return recent_.size() - first >= 3 && span_ns >= kFullShare * static_cast<double>(window_ns);
  };
  const size_t lately = since(kShortNs);
  if (full(lately, kShortNs) && spread(lately, recent_.size()).range < kSettledShare * hold_m_) {
    anchor_m_ = recent_.back().measured_m;
    return true;
  }
  if (!full(0, kWindowNs)) return false;
  const size_t middle = since(kWindowNs / 2);
  const Spread all = spread(0, recent_.size());
  const double change_m = spread(middle, recent_.size()).mean - spread(0, middle).mean;
  if (all.range > kTrembleBands * hold_m_ || std::abs(change_m) > kHalvesShare * hold_m_) return false;
  anchor_m_ = all.mean;
  return true;
}

double Standstill::report(int64_t stamp_ns, double measured_m) {
  remember(stamp_ns, measured_m);
  if (resting_) {
    resting_ = !left(measured_m);
  } else {
    resting_ = settled();
    outside_ = 0;
  }
  return resting_ ? anchor_m_ : measured_m;
}

double Standstill::recent_speed_mps() const {
  if (resting_ || recent_.size() < 2) return 0;
  const Place& then = recent_[std::min(since(kShortNs), recent_.size() - 2)];
  return (recent_.back().measured_m - then.measured_m) / core::seconds(recent_.back().stamp_ns - then.stamp_ns);
}

}  // namespace railfix::odometry
