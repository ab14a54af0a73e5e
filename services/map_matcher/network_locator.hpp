// Where on the network, without a prior: the way the track bent over the last kilometres, and the landmarks on it, are
// searched for on the whole map, in both directions, with an unknown scale of the odometer. Says several places with
// their probabilities, and "certain" only when nothing else fits.
#pragma once

#include <deque>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "map_matcher/locator_types.hpp"
#include "map_matcher/match_types.hpp"
#include "map_matcher/network_index.hpp"
#include "map_matcher/place_filter.hpp"
#include "map_matcher/way_fit.hpp"

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

  /// Moved forward by way_m (measured) and turned meanwhile (left positive). Running backwards begins anew.
  void move(double way_m, double turn_rad, double turn_sigma_rad);
  void sight(const Sighting& sighting);
  void forget();
  [[nodiscard]] double way_m() const { return static_cast<double>(bins_.size()) * kBinM; }
  /// Where the train is now. No places where the way is too short or too plain.
  [[nodiscard]] Location locate();

 private:
  [[nodiscard]] PlaceFilter& filtered(const MeasuredWay& way);
  [[nodiscard]] Location sum_up(const std::vector<WayFit>& fits) const;
  [[nodiscard]] Doubt doubt_of(const Location& location, bool complete, double evidence) const;
  [[nodiscard]] double beside_probability(const std::vector<LocatedPlace>& places) const;
  [[nodiscard]] LocatedPlace place_of(const WayFit& fit) const;
  [[nodiscard]] bool just_behind_switch(const LocatedPlace& place) const;

  LocatorParameters parameters_;
  std::shared_ptr<const NetworkIndex> index_;
  std::deque<MeasuredBin> bins_;  // oldest first
  size_t gone_bins_ = 0;          // in front of them
  std::optional<PlaceFilter> filter_;
  MeasuredBin open_;
  double open_m_ = 0;
};

}  // namespace railfix::map_matcher
