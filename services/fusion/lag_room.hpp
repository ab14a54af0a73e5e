// Room in the interval for a camera whose stamps may be late against the wheel's, or early: what it shows was a little
// earlier or later, so that the train is further on than its landmarks say, or not so far.
#pragma once

#include <optional>

#include "fusion/camera_lag.hpp"
#include "fusion/fusion_parameters.hpp"
#include "fusion/fusion_types.hpp"

namespace railfix::fusion {

class LagRoom {
 public:
  /// before: of an earlier trip; it bounds what is held as long as this one measures nothing else.
  void begin_with(const std::optional<CameraLag::Lag>& before, const FusionParameters& parameters);
  void forget_earlier_trips() { before_.reset(); }
  void add(const WheelInput& sample) { measured_.add(sample); }
  void add(const OdometryInput& step);
  /// Holds what nothing has ruled out, also before the camera is heard, for a second: the first stamp of all is the
  /// wheel's then. As far as the allowed width has room for that, and all of it where a lag is likely, the interval is
  /// wider anyway or the state is no position. One that is sure is said. States come in the order of their stamps.
  void widen(TrainEstimate& estimate, const FusionParameters& parameters);
  /// Fit to be kept for the next trip: nothing where it is vague or more than may be.
  [[nodiscard]] std::optional<CameraLag::Lag> to_keep(const FusionParameters& parameters) const;

 private:
  /// By a landmark the train is put back by the way of its lag at that speed. From there on this becomes the way at the
  /// speed of now where the camera counts, and stays where the wheel does: the train is between the two.
  struct Speeds {
    double slowest_mps = 0;
    double fastest_mps = 0;
  };
  [[nodiscard]] bool fits_before(const CameraLag::Lag& measured) const;
  [[nodiscard]] bool begins_with_the_wheel(const TrainEstimate& estimate);
  [[nodiscard]] std::optional<CameraLag::Lag> lag() const;
  [[nodiscard]] Speeds speeds_since_sure(const TrainEstimate& estimate);

  CameraLag measured_;
  std::optional<CameraLag::Lag> before_;
  Speeds speeds_;         // since the last sure place
  Speeds speeds_before_;  // since the one before it: which was sure is known later
  double since_sure_m_ = 0;
  double distance_m_ = 0;  // of the last state
  double last_speed_mps_ = 0;
  std::optional<int64_t> begun_ns_;
};

}  // namespace railfix::fusion
