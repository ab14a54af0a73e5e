// Trains on the tracks beside the path.
#pragma once

#include "simulator/renderer.hpp"
#include "simulator/trajectory.hpp"

namespace railfix::simulator {

/// `count` trains that the run meets, in turn on the tracks beside it: standing in loops, else towards it or overtaking
/// it. None where no track is beside the run for 60 m.
std::vector<OtherTrain> plan_traffic(const Trajectory& trajectory, int count, uint64_t seed);

}  // namespace railfix::simulator
