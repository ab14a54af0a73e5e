// A camera on a straight line of 20 km, one measurement at a time.
#pragma once

#include <gtest/gtest.h>

#include <cmath>
#include <memory>
#include <optional>

#include "core/time.hpp"
#include "fusion/fusion.hpp"

namespace railfix::fusion {

inline constexpr int64_t kBeginNs = 1'600'000'000'000'000'000;
inline int64_t at(double t_s) {
  return kBeginNs + core::to_ns(t_s);
}

inline std::shared_ptr<const track::Map> straight_line() {
  auto map = std::make_shared<track::Map>();
  map->edges.push_back({1, "line", 1, 2, "", track::Alignment::chained({0, 0, 0}, {{20000, 0, 0}})});
  map->nodes = {{1, track::NodeKind::end, "", 0, 0}, {2, track::NodeKind::end, "", 0, 20000}};
  return map;
}

inline Fusion fusion_at(double offset_m, const FusionParameters& parameters = {}) {
  return core::value_or_throw(
      Fusion::create(parameters, straight_line(), track::EdgePosition{1, offset_m, track::Direction::forward}));
}
inline Fusion fusion_without_start() {
  return core::value_or_throw(Fusion::create({}, straight_line(), std::nullopt));
}

inline OdometryInput step_at(double t_s, double speed_mps, double period_s = 0.02) {
  return {at(t_s), at(t_s - period_s), speed_mps * period_s, 0.001, true};
}
inline FixInput fix_at(double t_s, double offset_m, uint32_t landmark, double probability = 0.9999) {
  return {at(t_s), 1, offset_m, 0.1, probability, landmark, FixKind::landmark, track::Direction::forward, nullptr};
}
inline WheelInput wheel_at(double t_s, double metres) {
  return {at(t_s), static_cast<int64_t>(std::floor(metres * 100)), 100};
}

// Runs with constant speed from `from_s` to `to_s`; the last state.
inline TrainEstimate run(Fusion& fusion, double from_s, double to_s, double speed_mps) {
  std::optional<TrainEstimate> last;
  for (int i = 1; from_s + i * 0.02 <= to_s + 1e-9; ++i) {
    if (auto state = fusion.add(step_at(from_s + i * 0.02, speed_mps))) last = state;
  }
  EXPECT_TRUE(last);
  return last.value_or(TrainEstimate{});
}

}  // namespace railfix::fusion
