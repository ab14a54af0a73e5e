// Would what was sighted fit as well at another place of the same track? Somebody may have told a start some masts
// wrong, or with the cab looking the other way: masts at even distances agree there as here, however many are seen.
// What stands unevenly, a balise, a frog or a bridge does not.
#pragma once

#include "map_matcher/sighting_history.hpp"
#include "track/path.hpp"

namespace railfix::map_matcher {

/// Where the train is taken to be.
struct TakenPlace {
  double shift_m = 0;       // path distance less distance run
  double least_m = 0;       // other shifts that are meant by the place as well, ...
  double most_m = 0;        // ... because it is not known better
  double now_m = 0;         // distance run
  double since_told_m = 0;  // way from where somebody told it, signed
};

class AlikePlaces {
 public:
  /// Both must outlive it.
  AlikePlaces(const SightingHistory& history, const track::Path& path) : history_(history), path_(path) {}

  /// Another place within 1 km along the track where the sightings are nearly as likely, or one within 1 km of where
  /// the train was told to be from which it has run the other way.
  [[nodiscard]] bool any(const TakenPlace& place) const;

 private:
  struct Range {
    double least_m = 0;
    double most_m = 0;
    [[nodiscard]] bool has(double shift_m) const { return least_m < shift_m && shift_m < most_m; }
  };
  [[nodiscard]] bool any_likely(const SightingHistory& history, double now_m, const Range& shifts, const Range& but,
                                double likely) const;

  const SightingHistory& history_;
  const track::Path& path_;
};

}  // namespace railfix::map_matcher
