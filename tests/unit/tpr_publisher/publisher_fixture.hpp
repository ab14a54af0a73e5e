// A TprPublisher on balise_map(): its settings, and positions to follow.
#pragma once

#include "core/time.hpp"
#include "tpr_publisher/tpr_publisher.hpp"
#include "unit/tpr_publisher/balise_map.hpp"

namespace railfix::tpr_publisher::testing {

constexpr int64_t kStart = 1'700'000'000'000'000'000;

inline Settings settings() {
  Settings settings;
  settings.parameters.t_cycloc = 6;
  settings.report.nid_engine = 4711;
  settings.report.foot_to_front_m = 2;
  return settings;
}

inline TrainPosition at(const track::EdgePosition& foot, double run_s, double speed_mps) {
  TrainPosition position;
  position.stamp_ns = kStart + core::to_ns(run_s);
  position.foot = foot;
  position.track_known = true;
  position.track_probability = 1;
  position.speed_mps = speed_mps;
  position.distance_m = foot.offset_m;
  position.over_m = position.under_m = 3;
  position.standstill = speed_mps == 0;
  return position;
}

}  // namespace railfix::tpr_publisher::testing
