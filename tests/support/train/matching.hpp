// map_matcher in the loop with fusion: what the camera sees goes in, it searches where fusion says, and fusion is told
// what it finds. So errors follow from those of odometer and map, last, and a wrong place leads to the next one, as on
// a train.
#pragma once

#include <memory>
#include <vector>

#include "fusion/fusion.hpp"
#include "support/train/simulation.hpp"

namespace railfix::train {

class Matching {
 public:
  virtual ~Matching() = default;
  /// `state`: what fusion says behind this step. What comes out is due now, but may be late.
  virtual std::vector<fusion::FixInput> see(const fusion::OdometryInput& step, const fusion::TrainEstimate& state,
                                            double arrival_s) = 0;
  /// What it finds comes out with the next step or state.
  virtual void hear(const fusion::GnssInput& gnss, double arrival_s) = 0;
  virtual void feel(const fusion::ImuInput& sample) = 0;
  /// Between pictures. Without a camera the states lead, and what comes out is due now.
  virtual std::vector<fusion::FixInput> run_on(const fusion::TrainEstimate& state, double arrival_s) = 0;
};

/// As the plan says; nullptr where nothing is to be matched. REQUIRES: the simulation outlives it.
std::unique_ptr<Matching> matching_of(const TrainSimulation& simulation);

}  // namespace railfix::train
