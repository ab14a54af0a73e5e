// map_matcher's places from the shape of the track, in the loop with fusion: what the camera sees of the curvature goes
// into the real matcher, which searches where fusion says, and fusion is told what it finds. Its errors follow from
// those of the odometer and of the map, and last, as they do on a train.
#pragma once

#include <deque>
#include <memory>
#include <optional>

#include "fusion/fusion.hpp"
#include "map_matcher/curvature_matcher.hpp"
#include "map_matcher/step_chain.hpp"
#include "support/train/simulation.hpp"
#include "track/ways.hpp"

namespace railfix::train {

class ShapeFixes {
 public:
  /// REQUIRES: the simulation outlives this.
  explicit ShapeFixes(const TrainSimulation& simulation);

  /// `state`: what fusion says behind this step. What comes out is due now, but may be late.
  std::optional<fusion::FixInput> see(const fusion::OdometryInput& step, const fusion::TrainEstimate& state,
                                      double arrival_s);

 private:
  std::optional<fusion::FixInput> match(int64_t stamp_ns, const fusion::TrainEstimate& state);
  /// False while the place is not known.
  bool follow(const fusion::TrainEstimate& state);
  void look(double arrival_s, const Motion& truth);

  const TrainSimulation& simulation_;
  track::Ways ways_;
  std::shared_ptr<const track::Path> path_;
  double place_m_ = 0;  // on the path
  map_matcher::StepChain chain_;
  std::optional<map_matcher::CurvatureMatcher> matcher_;
  double matched_m_ = 0;
  std::deque<std::pair<double, fusion::FixInput>> found_;  // when they are due
  core::Random random_;
  double bias_per_m_;
  double wander_per_m_ = 0;
  double looked_m_ = 0;
  std::optional<double> stuck_per_m_;
};

}  // namespace railfix::train
