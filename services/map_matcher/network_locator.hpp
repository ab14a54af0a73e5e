// Where on the network, without a prior: the way the track bent over the last kilometres, and the landmarks on it, are
// searched for on the whole map, in both directions, with an unknown scale of the odometer. Says several places with
// their probabilities, and "certain" only when nothing else fits.
#pragma once

#include <deque>
#include <memory>
#include <vector>

#include "map_matcher/locator_types.hpp"
#include "map_matcher/match_types.hpp"
#include "map_matcher/network_index.hpp"
#include "map_matcher/way_fit.hpp"

namespace railfix::map_matcher {

struct LocatedPlace {
  track::EdgePosition place;
  double probability = 0;  // of this place on this track
  double sigma_m = 0;
  double scale = 1;   // true over measured metres
  double misfit = 0;  // mean of the squared errors in sigmas
};

struct Location {
  std::vector<LocatedPlace> places;  // best first
  double place_probability = 0;      // of the best place, on whichever of the tracks beside each other
  bool place_certain = false;        // tracks beside each other may still be open
  bool certain = false;              // the track too
  size_t candidates = 0;             // places that were compared in full
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
  [[nodiscard]] Location locate() const;

 private:
  [[nodiscard]] std::vector<WayFit> compare(const TurnModel& model, const std::vector<Candidate>& candidates,
                                            bool& complete) const;
  [[nodiscard]] std::vector<WayFit> first_fits(const WayFitter& fitter, const std::vector<WalkedWay>& ways,
                                               bool& complete) const;
  void add_beside(const WayWalker& walker, const WayFitter& fitter, std::vector<WayFit>& fits) const;
  [[nodiscard]] Location sum_up(const std::vector<WayFit>& fits) const;
  [[nodiscard]] LocatedPlace place_of(const WayFit& fit) const;
  [[nodiscard]] bool just_behind_switch(const LocatedPlace& place) const;

  LocatorParameters parameters_;
  std::shared_ptr<const NetworkIndex> index_;
  std::deque<MeasuredBin> bins_;  // oldest first
  MeasuredBin open_;
  double open_m_ = 0;
};

}  // namespace railfix::map_matcher
