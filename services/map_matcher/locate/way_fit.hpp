// The last step of the search on the whole network: on one way through the switches, where along it and with which
// scale of the odometer the measured turns fit, as a probability over both.
#pragma once

#include <optional>
#include <vector>

#include "map_matcher/locate/locator_types.hpp"
#include "map_matcher/locate/network_index.hpp"
#include "map_matcher/locate/way_walker.hpp"

namespace railfix::map_matcher {

/// Where the measured way ends on one way through the switches.
struct WayFit {
  std::vector<track::Run> runs;  // walked, and some way beyond
  double end_m = 0;              // mean, from the beginning of the first run, of the camera's foot
  double sigma_m = 0;
  double anchor_m = 0;  // of the best fit: where bin `bin` begins, of the foot
  size_t bin = 0;
  double scale = 1;         // of the best fit
  double best_log = 0;      // log likelihood
  double log_evidence = 0;  // ... summed over places and scales
  double misfit = 0;        // mean of the squared errors in sigmas, of the best fit
  double worst_misfit = 0;  // ... over the worst 200 m
};

/// The one of most evidence. REQUIRES: one at least.
const WayFit& best_of(const std::vector<WayFit>& fits);

/// A place `along_m` on runs that follow each other.
Candidate place_on(const std::vector<track::Run>& runs, double along_m);

class WayFitter {
 public:
  WayFitter(const TurnModel& model, const NetworkIndex& index) : model_(model), index_(index) {}

  /// How finely is looked: the grid is halved up to so many times, with the best trials of each.
  struct Effort {
    int halvings = 0;
    size_t most_kept = 0;
    double kept_below = 0;  // the best one, in log likelihood
  };
  /// Nothing below least_log.
  [[nodiscard]] std::optional<WayFit> fit(const WalkedWay& walked, const Effort& effort, double least_log);
  /// So many bins were compared by now: the time that it took.
  [[nodiscard]] size_t compared_bins() const { return compared_bins_; }

 private:
  class Shape;
  struct Trial {
    double shift_m = 0;
    double scale = 1;
    double log = 0;
    double misfit = 0;
    double worst_misfit = 0;
  };
  struct Grid {
    std::vector<Trial> trials;
    double shift_step_m = 0;
    double scale_step = 0;
  };
  [[nodiscard]] WalkedWay lengthened(WalkedWay walked) const;
  void weigh(const Shape& shape, const WalkedWay& walked, Trial& trial, double rough_m, double rough_scale,
             double least_log);
  [[nodiscard]] Grid search(const Shape& shape, const WalkedWay& walked, const Effort& effort, double least_log);
  const TurnModel& model_;
  const NetworkIndex& index_;
  size_t compared_bins_ = 0;
};

}  // namespace railfix::map_matcher
