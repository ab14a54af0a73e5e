// Where on the network, without a prior: the way the track bent over the last kilometres, and the landmarks on it, are
// searched for on the whole map, in both directions, with an unknown scale of the odometer. Says several places with
// their probabilities, and "certain" only when nothing else fits.
#pragma once

#include <array>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "map_matcher/locate/locator_types.hpp"
#include "map_matcher/locate/measured_run.hpp"
#include "map_matcher/locate/network_index.hpp"
#include "map_matcher/locate/place_filter.hpp"
#include "map_matcher/locate/way_fit.hpp"
#include "map_matcher/match_types.hpp"

namespace railfix::map_matcher {

struct LocatedPlace {
  track::EdgePosition place;
  double probability = 0;  // of this place on this track
  double sigma_m = 0;
  double scale = 1;         // true over measured metres
  double misfit = 0;        // mean of the squared errors in sigmas
  double worst_misfit = 0;  // ... over the worst 200 m
};

/// Why a place is not certain: the first that applies.
enum class Doubt : uint8_t {
  none,
  too_plain,     // the way is too short or bends too little
  not_all_seen,  // the place may be one that was not compared
  misfit,        // nothing fits to the noise
  by_chance,     // one of so many places would fit a track that is not on the map as well
  alike,         // several places fit
  wide,          // along the track
  beside,        // which of the tracks beside each other
  near_switch    // which leg of a switch that was just passed
};
std::string to_string(Doubt doubt);

struct Location {
  std::vector<LocatedPlace> places;  // best first
  double place_probability = 0;      // of the best place, on whichever of the tracks beside each other
  Doubt doubt = Doubt::too_plain;
  size_t candidates = 0;  // places that may be the one
  [[nodiscard]] bool certain() const { return doubt == Doubt::none; }
  /// Certain but for the track: those beside each other are still open.
  [[nodiscard]] bool place_certain() const { return doubt == Doubt::none || doubt >= Doubt::beside; }
};

class NetworkLocator {
 public:
  NetworkLocator(const LocatorParameters& parameters, std::shared_ptr<const NetworkIndex> index)
      : parameters_(parameters), index_(std::move(index)) {}

  /// Moved by way_m (measured, forward positive) and turned meanwhile (left positive).
  void move(double way_m, double turn_rad, double turn_sigma_rad);
  void sight(const Sighting& sighting);
  /// Some of the work of the next search, where the way has got longer since the last one. All of it once between two
  /// searches, where it begins anew, as behind a train that has set back.
  void prepare();
  void forget();
  /// That is searched for.
  [[nodiscard]] double way_m() const;
  /// Where the train is now, in the direction that its own front looks, whichever way it runs. No places where the way
  /// is too short or too plain, nor while the train is back from where it was before: it may have come back on another
  /// leg of a switch.
  [[nodiscard]] Location locate();

 private:
  /// The way ahead or astern, and the search on it.
  struct Search {
    MeasuredRun run;
    std::optional<PlaceFilter> filter;
  };
  /// The one that the train is at the front of, with the longer way.
  [[nodiscard]] size_t leading() const;
  void follow(Search& search, const MeasuredWay& way) const;
  [[nodiscard]] Location sum_up(const std::vector<WayFit>& fits, const MeasuredRun& run) const;
  [[nodiscard]] Doubt doubt_of(const Location& location, bool complete, double evidence) const;
  [[nodiscard]] double beside_probability(const std::vector<LocatedPlace>& places) const;
  [[nodiscard]] LocatedPlace place_of(const WayFit& fit, const MeasuredRun& run) const;
  [[nodiscard]] bool just_behind_switch(const LocatedPlace& place) const;

  LocatorParameters parameters_;
  std::shared_ptr<const NetworkIndex> index_;
  std::array<Search, 2> searches_{Search{{parameters_, MeasuredRun::Direction::ahead}, {}},
                                  Search{{parameters_, MeasuredRun::Direction::astern}, {}}};
  bool begun_ = false;  // anew by prepare(), since the last search
};

}  // namespace railfix::map_matcher
