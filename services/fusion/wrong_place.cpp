#include "fusion/wrong_place.hpp"

#include <algorithm>
#include <cmath>

namespace railfix::fusion {
namespace {

// Where a map lacks 15 to 80 m the landmarks are found again within 700 to 900 m.
constexpr double kLostM = 2000;
constexpr double kStrayedM = 1000;
constexpr double kDeniedM = 1000;
constexpr double kTurnedM = 600;     // turning otherwise counts for so much of the way behind it, ...
constexpr double kComesBack = 0.25;  // ... and is forgotten over four times as much

}  // namespace

void WrongPlace::found() {
  const double here_m = distance_m_;
  *this = {};
  distance_m_ = here_m;
}

// Where both are straight a train on another track turns alike, too.
void WrongPlace::move(double distance_m, SpeaksAgainst now) {
  const double way_m = std::abs(distance_m - distance_m_);
  distance_m_ = distance_m;
  lost_m_ = lost_ ? lost_m_ + way_m : 0;
  if (now.turning) turned_at_m_ = distance_m;
  const bool turned = turned_at_m_ && std::abs(distance_m - *turned_at_m_) < kTurnedM;
  strayed_m_ = std::max(0.0, strayed_m_ + (turned ? way_m : -kComesBack * way_m));
  denied_m_ = now.gnss ? denied_m_ + way_m : 0;
}

std::optional<Against> WrongPlace::proven() const {
  if (lost_m_ > kLostM) return Against::sightings;
  if (denied_m_ > kDeniedM) return Against::gnss;
  if (strayed_m_ > kStrayedM) return Against::turning;
  return std::nullopt;
}

}  // namespace railfix::fusion
