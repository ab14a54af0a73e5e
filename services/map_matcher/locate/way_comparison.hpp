// Which of the candidates fit the whole measured way, and how well: the best ones are followed and fitted first, and
// what cannot come near them is given up early.
#pragma once

#include <vector>

#include "map_matcher/locate/locator_types.hpp"
#include "map_matcher/locate/network_index.hpp"
#include "map_matcher/locate/way_fit.hpp"
#include "map_matcher/locate/way_walker.hpp"

namespace railfix::map_matcher {

struct ComparedWays {
  std::vector<WayFit> fits;
  bool complete = true;  // false: more might fit than could be looked at
};

class WayComparison {
 public:
  WayComparison(const TurnModel& model, const NetworkIndex& index)
      : model_(model), index_(index), walker_(model, index), fitter_(model, index) {}

  /// REQUIRES: the likely ones first.
  [[nodiscard]] ComparedWays compare(const std::vector<Candidate>& candidates);

 private:
  [[nodiscard]] std::vector<WayFit> first_fits(const std::vector<Candidate>& candidates, bool& complete);
  [[nodiscard]] std::vector<WalkedWay> roughly(const Candidate& candidate, double least_log);
  /// False where more ways lead there than were fitted.
  [[nodiscard]] bool fit_exactly(const WayFit& first, std::vector<WayFit>& fits, double& best);
  [[nodiscard]] bool add_beside(std::vector<WayFit>& fits);

  const TurnModel& model_;
  const NetworkIndex& index_;
  WayWalker walker_;
  WayFitter fitter_;
};

}  // namespace railfix::map_matcher
