// The places on a route where the train can be, one every metre: how well the turning fits there, with the sensor's
// bias and the sway of the body that fit best. The bias of a gyro may also have become another one at any time: as well
// as that fits is kept beside, so that a gyro that has failed makes the track unknown and not a wrong one certain.
#pragma once

#include <Eigen/Core>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "map_matcher/track_choice/track_parameters.hpp"
#include "track/ways.hpp"

namespace railfix::map_matcher {

constexpr double kCellM = 1.0;

/// What is not of the track in the turning: the sensor's bias (in its sigmas) and how far the body has turned on its
/// springs (rad).
struct TurnErrors {
  enum Index : uint8_t { bias, sway };
  Eigen::Vector2d mean = Eigen::Vector2d::Zero();
  Eigen::Matrix2d covariance = Eigen::Vector2d(1, 4e-6).asDiagonal();
  /// Nothing is known of it any more: as before the first measurement.
  void forget(Index error);
};

/// Logarithm of the sum of what two logarithms stand for.
double log_sum(double a, double b);

/// How well the turning fits, with one way in which the errors may have come about.
struct TurnFit {
  double log_weight = -INFINITY;
  TurnErrors errors{};
};

struct TurnCell {
  static constexpr size_t kFits = 4;
  /// The first: the sensor's bias is what it was. The others: it has jumped since, each begun at another time, the same
  /// one in all cells.
  std::array<TurnFit, kFits> fits{TurnFit{0, {}}};
  [[nodiscard]] double log_weight() const;
  void add_log(double log);
  void forget(TurnErrors::Index error);
  /// Another sensor turns from now on.
  void begin_sensor();
};

/// Turned over some way.
struct BinTurn {
  double way_m = 0;
  double turn_rad = 0;
  double variance = 0;
  double bias_rad = 0;    // one sigma of the sensor's bias
  double bias_walk = 0;   // as in Turn
  double duration_s = 0;  // 0: not known
  double jump_rad = 0;    // what one sigma of another bias has turned; 0: the sensor's does not jump
};

/// The bias may have jumped just now, with this chance: in the place of this fit.
void begin_jump(TurnCell& cell, size_t fit, const BinTurn& bin, double chance);

/// Weighs the cells, of which the first is first_m along the route.
void weigh_turn(std::vector<TurnCell>& cells, double first_m, const track::Route& route, const BinTurn& bin,
                const TrackParameters& parameters);
/// The way run is not known exactly: what is believed of a cell goes over to its neighbours.
void spread(std::vector<TurnCell>& cells, double way_m);
/// The train stood: all that the sensor turned is its own error.
void weigh_stand(TurnCell& cell, const BinTurn& stood, const TrackParameters& parameters);
/// Both cells are one place: `into` gets what is known of it when they have these weights beside their own.
void join_cells(TurnCell& into, double log_into, const TurnCell& other, double log_other);

}  // namespace railfix::map_matcher
