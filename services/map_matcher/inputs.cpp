#include "map_matcher/inputs.hpp"

#include <cmath>

#include "core/train_limits.hpp"
#include "core/within.hpp"

namespace railfix::map_matcher {

using core::positive;
using core::up_to;
using core::within;

namespace {

constexpr double kFarthestM = 1000;  // of what is sighted, or run in one step
constexpr double kLongestM = 1e9;    // a count of metres, an offset, a coordinate
constexpr double kMostTurnRad = 10;  // in one step, or in a second
constexpr double kTightestPerM = 1;  // curvature
constexpr double kMostHdop = 1e6;

}  // namespace

bool has_sense(const Sighting& s) {
  return track::can_be_sighted(s.kind) && up_to(s.distance_ahead_m, kFarthestM) && up_to(s.lateral_m, kFarthestM) &&
         positive(s.sigma_m, kFarthestM) && within(s.confidence, 0, 1);
}

bool has_sense(const Turn& t) {
  return up_to(t.way_m, kFarthestM) && up_to(t.turn_rad, kMostTurnRad) && within(t.sigma_rad, 0, kMostTurnRad) &&
         within(t.bias_rad, 0, kMostTurnRad) && t.bias_walk >= 0 && t.duration_s >= 0;
}

bool has_sense(const StepInput& s) {
  if (!s.measured) return true;
  return s.reference_stamp_ns < s.stamp_ns && up_to(s.step_m, kFarthestM) && up_to(s.yaw_rad, kMostTurnRad) &&
         within(s.yaw_sigma_rad, 0, kMostTurnRad) && up_to(s.distance_m, kLongestM) &&
         up_to(s.speed_mps, core::kFastestTrainMps);
}

bool has_sense(const ViewInput& v) {
  return up_to(v.curvature_per_m, kTightestPerM) && positive(v.variance, kTightestPerM);
}

bool has_sense(const GyroInput& g) {
  return up_to(g.rate_rps, kMostTurnRad);
}

bool has_sense(const GnssInput& g) {
  return up_to(g.easting_m, kLongestM) && up_to(g.northing_m, kLongestM) && within(g.hdop, 0, kMostHdop);
}

bool has_sense(const StateInput& s) {
  const PlacedTrain& p = s.placed;
  return up_to(p.place.offset_m, kLongestM) && up_to(p.distance_m, kLongestM) && p.over_m >= 0 && p.under_m >= 0 &&
         (std::isnan(p.speed_mps) || up_to(p.speed_mps, core::kFastestTrainMps)) && s.sigma_m >= 0 &&
         within(s.track_probability, 0, 1) && within(s.visual_scale, 0, 2) && up_to(s.pose.easting_m, kLongestM) &&
         up_to(s.pose.northing_m, kLongestM);
}

}  // namespace railfix::map_matcher
