// How far the train ran and turned from one odometry step to the next, whichever process measures: one that begins anew
// counts its distance from zero, and pictures may be missing between two steps.
#pragma once

#include <cstdint>
#include <optional>

#include "map_matcher/match_types.hpp"

namespace railfix::map_matcher {

/// Turning of the car body within one step, rad.
inline constexpr double kYawNoiseRad = 3e-4;

/// One OdometryStep.
struct StepInput {
  int64_t stamp_ns = 0;
  int64_t reference_stamp_ns = 0;  // of the picture that the step counts from
  bool measured = false;           // otherwise blind, or searching
  double step_m = 0;
  double yaw_rad = 0;
  double yaw_sigma_rad = 0;
  double distance_m = 0;  // of that process
  double speed_mps = 0;
  bool frame_to_frame = true;  // otherwise against a key frame: such steps overlap
};

class StepChain {
 public:
  void add(const StepInput& step);
  /// The way of all steps: it never jumps, but is not known over a break.
  [[nodiscard]] double odometer_m() const { return odometer_m_; }
  /// Nobody measured the way to the last step.
  [[nodiscard]] bool broken() const { return broken_; }
  /// What the last step adds to the one before it, as the camera saw it; nothing when no picture links the two.
  [[nodiscard]] const std::optional<Turn>& turn() const { return turn_; }

 private:
  [[nodiscard]] std::optional<double> way_to(const StepInput& step) const;
  [[nodiscard]] bool linked(const StepInput& step) const;
  [[nodiscard]] Turn turn_to(const StepInput& step, double way_m) const;

  std::optional<StepInput> last_;
  double odometer_m_ = 0;
  bool broken_ = true;
  std::optional<Turn> turn_;
};

}  // namespace railfix::map_matcher
