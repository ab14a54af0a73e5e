#include "fusion/track_doubt.hpp"

#include <algorithm>
#include <cmath>

namespace railfix::fusion {
namespace {

constexpr double kSameSwitchM = 1.0;  // a path that was joined anew may have it elsewhere by so much

}  // namespace

void TrackDoubt::said(double probability, std::optional<double> of_m, double place_m) {
  said_ = probability;
  place_m_ = place_m;
  std::erase_if(open_, [&](const track::PathSwitch& one) {
    const bool between = of_m && (one.distance_m - *of_m) * (one.distance_m - place_m) < 0;
    return !between;
  });
}

void TrackDoubt::move(const track::Path& path, double place_m) {
  const double from_m = place_m_.value_or(place_m);
  place_m_ = place_m;
  const bool ahead = place_m > from_m;
  const double low_m = std::min(from_m, place_m);
  const double high_m = std::max(from_m, place_m);
  const auto& all = path.switches();
  auto one = std::upper_bound(all.begin(), all.end(), low_m,
                              [](double m, const track::PathSwitch& s) { return m < s.distance_m; });
  for (; one != all.end() && one->distance_m <= high_m; ++one) {
    // Back over a switch that was run over the other way: it does not matter any more which way was taken.
    std::erase_if(open_, [&](const track::PathSwitch& s) {
      return s.ahead != ahead && std::abs(s.distance_m - one->distance_m) < kSameSwitchM;
    });
    if (one->ahead == ahead) open_.push_back(*one);
  }
}

double TrackDoubt::probability() const {
  double probability = said_;
  for (const auto& one : open_) probability /= one.ways;
  return probability;
}

double TrackDoubt::probability_at(const track::Path& path, double place_m) const {
  TrackDoubt there = *this;
  there.move(path, place_m);
  return there.probability();
}

}  // namespace railfix::fusion
