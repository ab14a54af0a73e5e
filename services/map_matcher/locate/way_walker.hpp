// Follows a candidate over the whole measured way, ahead and behind, through every leg of every switch; what does not
// fit is given up on the way.
#pragma once

#include <vector>

#include "map_matcher/locate/locator_types.hpp"
#include "map_matcher/locate/network_index.hpp"

namespace railfix::map_matcher {

/// The runs that the train would have taken.
struct WalkedWay {
  std::vector<track::Run> runs;
  double anchor_m = 0;  // from the beginning of the first run to the candidate
  size_t bin = 0;       // that begins there
  double scale = 1;
  double log = 0;
};

class WayWalker {
 public:
  WayWalker(const TurnModel& model, const NetworkIndex& index) : model_(model), index_(index) {}

  /// Best first. The place is known to rough_m and the scale to rough_scale; ways below least_log are given up.
  struct Trial {
    double rough_m = 0;
    double rough_scale = 0;
    size_t most_ways = 4;
  };
  [[nodiscard]] std::vector<WalkedWay> follow(const Candidate& candidate, const Trial& trial, double least_log);
  /// The last time a way was given up that fitted nearly as well as others, because there were too many.
  [[nodiscard]] bool cut() const { return cut_; }
  /// So many bins were compared by now: the time that it took.
  [[nodiscard]] size_t compared_bins() const { return compared_bins_; }

 private:
  struct Step;
  struct Walk;
  void step(const Walk& from, double way_m, std::vector<Walk>& to, int depth) const;
  [[nodiscard]] double of_marks(const Walk& before, const Walk& after, size_t bin, double scale, bool ahead,
                                double rough_m) const;
  [[nodiscard]] std::vector<Walk> go(std::vector<Walk> walks, size_t bin, bool ahead, const Candidate& candidate,
                                     const Trial& trial, double least_log);

  [[nodiscard]] static WalkedWay joined(const Walk& behind, const Walk& ahead, const Candidate& candidate);

  const TurnModel& model_;
  const NetworkIndex& index_;
  size_t compared_bins_ = 0;
  bool cut_ = false;
};

}  // namespace railfix::map_matcher
