// The places on a route where the train can be, one every metre: how well the turning fits there, with the sensor's
// bias that fits best.
#pragma once

#include <vector>

#include "map_matcher/track_choice/track_parameters.hpp"
#include "track/ways.hpp"

namespace railfix::map_matcher {

constexpr double kCellM = 1.0;

struct TurnCell {
  double log_weight = 0;
  double bias = 0;  // of the sensor, in its sigmas
  double bias_variance = 1;
};

/// Turned over some way.
struct BinTurn {
  double way_m = 0;
  double turn_rad = 0;
  double variance = 0;
  double bias_rad = 0;  // one sigma of the sensor's bias
};

/// Weighs the cells, of which the first is first_m along the route.
void weigh_turn(std::vector<TurnCell>& cells, double first_m, const track::Route& route, const BinTurn& bin,
                const TrackParameters& parameters);
/// The way run is not known exactly: what is believed of a cell goes over to its neighbours.
void spread(std::vector<TurnCell>& cells, double way_m);
/// Weighs a cell with the error of a measurement, and corrects its bias.
void learn_bias(TurnCell& cell, double error, double own_variance, double bias_gain);

}  // namespace railfix::map_matcher
