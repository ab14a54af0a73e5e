// One trip of `railfix-measure-matching locate`: a train that starts anywhere on a map and does not know where.
#pragma once

#include <cmath>
#include <memory>
#include <optional>
#include <vector>

#include "core/random.hpp"
#include "map_matcher/locate/gnss_search.hpp"
#include "map_matcher/locate/network_locator.hpp"
#include "matching.hpp"

namespace railfix::measure {

struct Trip {
  bool found = false;        // the track was certain ...
  bool place_found = false;  // ... or the place, tracks beside each other still open
  bool wrong = false;
  double found_after_m = 0;
  double place_after_m = 0;
  bool best_right = false;  // at the end, certain or not
  std::optional<double> by_gnss_after_m;
  bool gnss_wrong = false;  // GNSS found another track, the other direction, or a place that is more than 4 sigma off
  std::vector<double> searches_s;  // all the work of each ...
  std::vector<double> answers_s;   // ... and what of it is left when the train has come there
  double most_prepared_s = 0;      // of the other work the longest piece
  std::vector<map_matcher::Doubt> doubts;
  double turn_rad = 0;        // of the true track, over stretches of 20 m
  double most_sigmas = 0;     // error of a place that was certain
  double bound_m = INFINITY;  // least error that could be had on the way
};

/// What the locator knows, and where the train really is: mostly the same.
struct Networks {
  std::shared_ptr<const map_matcher::NetworkIndex> known;
  std::shared_ptr<const map_matcher::NetworkIndex> real;
};

double processor_s();

/// Nothing where the track ends too early, or has no switch where the options want one.
std::optional<Trip> run_trip(const Networks& networks, const MatchingOptions& options, core::Random& random);

}  // namespace railfix::measure
