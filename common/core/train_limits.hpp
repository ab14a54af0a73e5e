// What no train does, generously: a number beyond these in a table is a fault of the table.
#pragma once

namespace railfix::core {

constexpr double kFastestTrainMps = 200;
constexpr double kFarthestM = 1e8;  // co-ordinates, ways of a run, lengths
constexpr double kFarthestSeenM = 1e4;

}  // namespace railfix::core
