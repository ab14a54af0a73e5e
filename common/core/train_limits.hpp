// What no train does, generously: a number beyond these in a table is a fault of the table.
#pragma once

namespace railfix::core {

constexpr double kFastestTrainMps = 200;
constexpr double kFarthestM = 1e8;  // co-ordinates, ways of a run, lengths
constexpr double kFarthestSeenM = 1e4;
constexpr double kWidestM = 1e12;  // an interval, a sigma: nothing bounds them where nothing measures

}  // namespace railfix::core
