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

/// Nothing else is wrong.
inline constexpr const char* kOnlyTold = "the place was only told: waits for a landmark or curves";
inline constexpr const char* kToldAndGnss =
    "the place was only told, and GNSS agrees to some 10 m only: waits for a landmark or curves";

/// At constant speed nothing shows that the camera is not late: in these rides it is believed.
inline constexpr double kAnyLagS = 1;

inline std::shared_ptr<const track::Map> straight_line() {
  auto map = std::make_shared<track::Map>();
  map->edges.push_back({1, "line", 1, 2, "", track::Alignment::chained({0, 0, 0}, {{20000, 0, 0}})});
  map->nodes = {{1, track::NodeKind::end, "", 0, 0}, {2, track::NodeKind::end, "", 0, 20000}};
  return map;
}

inline Fusion fusion_at(double offset_m, const std::optional<SavedScales>& saved = std::nullopt) {
  return core::value_or_throw(Fusion::create({.camera_lag_s = kAnyLagS}, straight_line(),
                                             track::EdgePosition{1, offset_m, track::Direction::forward}, saved));
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
/// With which map_matcher knows that the train is nowhere else.
inline FixInput sure_fix_at(double t_s, double offset_m, uint32_t landmark) {
  auto fix = fix_at(t_s, offset_m, landmark);
  fix.sightings_fit = SightingsFit::here;
  return fix;
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

/// A train that runs 20 m/s over landmarks every so often, by a camera that counts a metre on `camera` true ones, and a
/// wheel likewise when there is one.
class Passage {
 public:
  struct Plan {
    double camera = 1;
    std::optional<double> wheel = std::nullopt;
    std::optional<SavedScales> saved = std::nullopt;
  };
  explicit Passage(const Plan& plan) : fusion_(fusion_at(0, plan.saved)), plan_(plan) {}

  /// Runs to the true place; every state must hold the train.
  void run_to(double place_m) {
    while (place_m_ < place_m) {
      if (plan_.wheel) fusion_.add(wheel_at(t_s_, place_m_ / *plan_.wheel));
      t_s_ += kPeriodS;
      place_m_ += kSpeedMps * kPeriodS;
      const double step_m = kSpeedMps * kPeriodS / plan_.camera;
      state_ = fusion_.add(OdometryInput{at(t_s_), at(t_s_ - kPeriodS), step_m, 0.001, true});
      ASSERT_TRUE(state_);
      ASSERT_LT(error_m(), state_->over_m) << "at " << place_m_ << " m";
      ASSERT_LT(-error_m(), state_->under_m) << "at " << place_m_ << " m";
    }
  }
  /// A landmark here, sighted so far ahead of where it is.
  void sight(double wrong_m) { fusion_.add(fix_at(t_s_, place_m_ + wrong_m, ++landmark_, 0.999999)); }
  void sight_again(double wrong_m) { fusion_.add(fix_at(t_s_, place_m_ + wrong_m, landmark_, 0.999999)); }
  [[nodiscard]] double error_m() const { return state_->position.offset_m - place_m_; }
  [[nodiscard]] double scale_error() const { return state_->visual_scale - plan_.camera; }
  [[nodiscard]] const TrainEstimate& state() const { return *state_; }
  [[nodiscard]] const Fusion& fusion() const { return fusion_; }

 private:
  static constexpr double kPeriodS = 0.1;
  static constexpr double kSpeedMps = 20;
  Fusion fusion_;
  Plan plan_;
  double t_s_ = 0;
  double place_m_ = 0;
  uint32_t landmark_ = 0;
  std::optional<TrainEstimate> state_;
};

}  // namespace railfix::fusion
