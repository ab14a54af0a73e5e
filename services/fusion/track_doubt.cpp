#include "fusion/track_doubt.hpp"

#include <algorithm>
#include <cmath>

namespace railfix::fusion {
namespace {

constexpr size_t kMostOpen = 100;     // the one before has been divided by all of these anyway
constexpr double kSameSwitchM = 1.0;  // a path that was joined anew may have it elsewhere by so much
// Seconds in which the train turns otherwise, or as the track does: one may be a bump.
constexpr int kTurnsToDoubt = 3;
constexpr int kTurnsToBelieve = 5;
constexpr double kDisbelieved = 0.1;
constexpr double kTurnsOtherwise = 0.5;  // the gyro may be wrong as well as the track

}  // namespace

void TrackDoubt::said(double probability, std::optional<double> of_m, double place_m) {
  said_ = probability;
  place_m_ = place_m;
  std::erase_if(open_, [&](const track::PathSwitch& one) {
    const bool between = of_m && (one.distance_m - *of_m) * (one.distance_m - place_m) < 0;
    return !between;
  });
}

void TrackDoubt::changed() {
  turned_otherwise_ = turned_alike_ = 0;
  turns_otherwise_ = false;
}

void TrackDoubt::seen_elsewhere(double probability) {
  here_at_most_ = std::min(here_at_most_, 1 - probability);
}

void TrackDoubt::seen_here() {
  changed();
  divided_ = false;
  here_at_most_ = 1;
}

void TrackDoubt::found_here() {
  seen_here();
  divided_ = true;
}

void TrackDoubt::turned(bool fits, bool bends) {
  turned_otherwise_ = fits ? 0 : turned_otherwise_ + 1;
  if (!fits) turned_alike_ = 0;
  if (fits && bends) ++turned_alike_;
  if (turned_alike_ >= kTurnsToBelieve) turns_otherwise_ = false;
  if (divided_ && turned_otherwise_ >= kTurnsToDoubt) turns_otherwise_ = true;
}

bool TrackDoubt::disbelieved() const {
  return said_ < kDisbelieved;
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
    if (one->ahead != ahead) continue;
    if (open_.size() == kMostOpen) {
      said_ /= open_.front().ways;
      open_.erase(open_.begin());
    }
    open_.push_back(*one);
    divided_ = true;
    divided_at_m_ = one->distance_m;
  }
}

double TrackDoubt::probability() const {
  double probability = said_;
  for (const auto& one : open_) probability /= one.ways;
  return std::min({probability, here_at_most_, turns_otherwise_ ? kTurnsOtherwise : 1.0});
}

double TrackDoubt::probability_at(const track::Path& path, double place_m) const {
  TrackDoubt there = *this;
  there.move(path, place_m);
  return there.probability();
}

}  // namespace railfix::fusion
