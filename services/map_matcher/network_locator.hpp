// Where on the network, without a prior: the way the track bent over the last kilometres, and the landmarks on it, are
// searched for on the whole map, in both directions, with an unknown scale of the odometer. Says several places with
// their probabilities, and "certain" only when nothing else fits.
#pragma once

#include <deque>
#include <memory>
#include <vector>

#include "map_matcher/match_types.hpp"
#include "track/ways.hpp"

namespace railfix::map_matcher {

struct LocatorParameters {
  double window_m = 6000;         // longest way that is searched for
  double least_way_m = 800;       // shorter ways are not searched for
  double least_turn_rad = 0.4;    // nor ways that bend less (sum of the turns, left and right)
  double scale_range = 0.02;      // of the odometer
  double noise_per_m = 2e-4;      // least sigma of the curvature over 20 m: body, map
  double curvature_share = 0.05;  // of the mapped curvature
  double bias_per_m = 1e-4;       // constant error of the measured curvature, one sigma
  double correlated_bins = 3.0;   // neighbouring bins err together
  double lag_m = 20.0;            // the car body may turn up to so far behind the foot
  double detection = 0.8;         // chance that a mapped balise is sighted
  double false_per_m = 0.0005;
  double certain = 0.9999;      // probability from which on the place is certain ...
  double certain_misfit = 2.0;  // ... when the bins fit to so many sigmas squared in the mean
};

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

/// The shape of a whole network, made once (a second for 20,000 km).
class NetworkIndex {
 public:
  static constexpr double kCellM = 10.0;
  explicit NetworkIndex(std::shared_ptr<const track::Map> map);

  struct Leg {
    track::Run run;
    double begin_m = 0;
  };
  /// Runs that follow each other straight on, with the heading every cell.
  struct Chain {
    std::vector<Leg> legs;
    std::vector<float> heading_rad;
    double length_m = 0;
  };
  [[nodiscard]] const std::vector<Chain>& chains() const { return chains_; }
  [[nodiscard]] const track::Ways& ways() const { return ways_; }
  [[nodiscard]] const track::Map& map() const { return *map_; }
  /// Heading on an edge relative to its start, along growing offset.
  [[nodiscard]] double heading_on(const track::Edge& edge, double offset_m) const;
  [[nodiscard]] const std::vector<const track::Landmark*>& balises_on(const track::Edge& edge) const {
    return balises_[edge.id - 1];
  }

 private:
  void add_chain(const track::Run& first, std::vector<bool>& used);
  std::shared_ptr<const track::Map> map_;
  track::Ways ways_;
  std::vector<std::vector<float>> headings_;  // of each edge, every cell
  std::vector<std::vector<const track::Landmark*>> balises_;
  std::vector<Chain> chains_;
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
  static constexpr double kBinM = 20.0;
  struct Bin {
    double turn_rad = 0;
    double variance = 0;
    std::vector<double> balises_m;  // from the bin's beginning
  };
  struct Walk;
  struct Fit;
  struct Candidate {
    track::Run run;
    double into_m = 0;  // of the beginning of bin `bin`
    size_t bin = 0;
    double squared = 0;
  };
  /// A stretch that is looked for first, as turns of its segments.
  struct Window {
    size_t first_bin = 0;
    size_t segment_bins = 0;
    std::vector<double> turns;
    std::vector<double> tolerances;
  };
  /// How a candidate is followed: from a little further, with another scale, roughly or exactly.
  struct Trial {
    double shift_m = 0;
    double scale = 1;
    bool rough = false;
  };
  [[nodiscard]] std::vector<Candidate> coarse(size_t segment_bins, size_t segments) const;
  [[nodiscard]] Window window_at(size_t first_bin, size_t segment_bins, size_t segments) const;
  [[nodiscard]] std::vector<size_t> uneven_stretches(size_t bins) const;
  void coarse_on(const NetworkIndex::Chain& chain, bool forward, const Window& window,
                 std::vector<Candidate>& found) const;
  [[nodiscard]] std::vector<Candidate> screen(std::vector<Candidate> candidates) const;
  void compare(const Candidate& candidate, bool fine, double& best_log, std::vector<Fit>& fits) const;
  [[nodiscard]] std::vector<Walk> walk(const Candidate& candidate, const Trial& trial, double least_log) const;
  void step(const Walk& from, double way_m, std::vector<Walk>& to, int depth) const;
  void weigh(Walk& walk, size_t bin, const Trial& trial, double rough_m) const;
  [[nodiscard]] bool just_behind_switch(const track::EdgePosition& place) const;
  [[nodiscard]] Location sum_up(const std::vector<Fit>& fits) const;

  LocatorParameters parameters_;
  std::shared_ptr<const NetworkIndex> index_;
  std::deque<Bin> bins_;  // oldest first
  Bin open_;
  double open_m_ = 0;
};

}  // namespace railfix::map_matcher
