// Whether odometry's turn is that of the camera's foot: a turn that leads or lags is of another place of the track, and
// passes for another leg of a switch or another chainage.
#pragma once

#include <cstddef>
#include <vector>

#include "evaluation/run_tables.hpp"
#include "evaluation/statistics.hpp"
#include "evaluation/truth.hpp"

namespace railfix::evaluation {

struct TurnResult {
  size_t stretches = 0;         // of 300 m without a gap, run forwards
  double error_rad = kUnknown;  // rms in them, beside a constant error and one that grows evenly
  double lead_m = kUnknown;     // it is the turn of the track so far ahead of the foot; nothing on straight track
};
TurnResult judge_turn(const Truth& truth, const std::vector<OdometryRow>& rows);

}  // namespace railfix::evaluation
