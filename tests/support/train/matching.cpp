#include "support/train/matching.hpp"

#include "support/train/matcher_loop.hpp"
#include "support/train/whole_matcher.hpp"

namespace railfix::train {

std::unique_ptr<Matching> matching_of(const TrainSimulation& simulation) {
  const auto& plan = simulation.plan();
  if (plan.whole_matcher) return std::make_unique<WholeMatcher>(simulation);
  if (plan.shape || plan.sightings) return std::make_unique<MatcherLoop>(simulation);
  return nullptr;
}

}  // namespace railfix::train
