#include "fusion/wrong_place.hpp"

#include <algorithm>

namespace railfix::fusion {
namespace {

// Where a map lacks 15 to 80 m the landmarks are found again within 700 to 900 m.
constexpr double kLostM = 2000;
constexpr double kWithGnss = 2;  // times as fast, where GNSS contradicts the place as well
constexpr double kOffMapM = 1000;
constexpr double kTurningM = 1000;
constexpr double kTurnedM = 600;     // turning otherwise counts for so much of the way behind it, ...
constexpr double kComesBack = 0.25;  // ... and is forgotten over four times as much

}  // namespace

void WrongPlace::found() {
  *this = {};
}

// Where both are straight a train on another track turns alike, too.
void WrongPlace::move(double way_m, SpeaksAgainst now) {
  lost_m_ = lost_ ? lost_m_ + (now.gnss ? kWithGnss : 1) * way_m : 0;
  off_map_m_ = now.off_map ? off_map_m_ + way_m : 0;
  since_turned_m_ = now.turning_now ? 0 : since_turned_m_ + way_m;
  const bool turns = now.turning && since_turned_m_ < kTurnedM;
  turning_m_ = std::max(0.0, turning_m_ + (turns ? way_m : -kComesBack * way_m));
}

std::optional<Against> WrongPlace::proven() const {
  if (lost_m_ > kLostM) return of_before_ ? Against::fusion_before : Against::sightings;
  if (turning_m_ > kTurningM) return Against::turning;
  if (off_map_m_ > kOffMapM) return Against::map_end;
  return std::nullopt;
}

}  // namespace railfix::fusion
