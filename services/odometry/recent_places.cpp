#include "odometry/recent_places.hpp"

#include <algorithm>
#include <cmath>

#include "core/time.hpp"

namespace railfix::odometry {

void RecentPlaces::remember(int64_t stamp_ns, double measured_m) {
  if (places_.size() == kMost) places_.erase(places_.begin());
  places_.push_back({stamp_ns, measured_m});
  const size_t old = std::min(since(core::kNsPerSecond), std::max<size_t>(places_.size(), 2) - 2);
  places_.erase(places_.begin(), places_.begin() + static_cast<std::ptrdiff_t>(old));
}

void RecentPlaces::shift(double by_m) {
  for (Place& place : places_) place.measured_m += by_m;
}

size_t RecentPlaces::since(int64_t age_ns) const {
  size_t first = 0;
  while (span_ns(first) > age_ns) ++first;
  return first;
}

RecentPlaces::Spread RecentPlaces::spread(size_t first, size_t end) const {
  const auto count = static_cast<double>(end - first);
  double sum = 0;
  double low_m = places_[first].measured_m;
  double high_m = low_m;
  for (size_t i = first; i < end; ++i) {
    sum += places_[i].measured_m;
    low_m = std::min(low_m, places_[i].measured_m);
    high_m = std::max(high_m, places_[i].measured_m);
  }
  Spread spread{sum / count, 0, high_m - low_m};
  double squares = 0;
  for (size_t i = first; i < end; ++i) squares += std::pow(places_[i].measured_m - spread.mean_m, 2);
  spread.rms_m = std::sqrt(squares / count);
  return spread;
}

double RecentPlaces::speed_mps(int64_t least_ns) const {
  if (places_.size() < 2) return 0;
  size_t first = places_.size() - 2;
  while (first > 0 && span_ns(first) < least_ns) --first;
  return (places_.back().measured_m - places_[first].measured_m) / core::seconds(span_ns(first));
}

}  // namespace railfix::odometry
