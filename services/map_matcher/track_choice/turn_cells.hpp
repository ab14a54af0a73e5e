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
  double bias_rad = 0;   // one sigma of the sensor's bias
  double bias_walk = 0;  // as in Turn
};

/// Logarithm of the sum of what two logarithms stand for.
double log_sum(double a, double b);

/// Weighs the cells, of which the first is first_m along the route.
void weigh_turn(std::vector<TurnCell>& cells, double first_m, const track::Route& route, const BinTurn& bin,
                const TrackParameters& parameters);
/// The way run is not known exactly: what is believed of a cell goes over to its neighbours.
void spread(std::vector<TurnCell>& cells, double way_m);
/// The bias may have changed by so much (variance, in its sigmas).
void loosen_bias(TurnCell& cell, double variance);
/// Both cells are one place: `into` gets what is known of it when they have these weights beside their own.
void join_cells(TurnCell& into, double log_into, const TurnCell& other, double log_other);
/// Weighs a cell with the error of a measurement, and corrects its bias.
void learn_bias(TurnCell& cell, double error, double own_variance, double bias_gain);

}  // namespace railfix::map_matcher
