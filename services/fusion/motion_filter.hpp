// Error-state filter of the train's motion along its path, in U-D factors (002, section 2.2 and eq. 5).
//
// The train's motion is kept in the metres of one odometer (the camera's or the wheel's, whichever measured first: the
// unit), so that this sensor's measurements are linear and can never seem to show their own scale. States, behind the
// clones: camera's own odometer [m], distance run [m], path distance of its origin [m], speed [unit m/s], acceleration,
// accelerometer bias [m/s^2], scale of the unit - 1, the other odometer's scale against the unit - 1, wheel's own
// odometer [m], gyro bias [rad/s], lasting error of the track's shape [m] and of GNSS [its sigma]. Both odometers
// stray from the train's way at random. Position on the path = distance + origin, so that distance runs on whether or
// not the place on the map is known. A clone is the camera's odometer at one picture; steps since that picture compare
// with it. What lasts is a state of its own, because fixes that err alike must not be taken for independent ones
// (coloured measurement noise: Bryson and Henrikson 1968).
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "estimation/ud_filter.hpp"
#include "fusion/fusion_parameters.hpp"
#include "fusion/odometer_scales.hpp"

namespace railfix::fusion {

enum class StateIndex : int {
  camera_odometer,
  distance,
  origin,
  speed,
  acceleration,
  accel_bias,
  unit_scale,
  other_scale,
  wheel_odometer,
  gyro_bias,
  shape_error,
  gnss_error,
  count
};

enum class Odometer : uint8_t { none, camera, wheel };

/// A measured path distance: noise of its own, and so many metres of a lasting error where that is a state.
struct MeasuredPlace {
  double path_distance_m = 0;
  double sigma_m = 0;
  std::optional<StateIndex> lasting = std::nullopt;
  double per_lasting = 1;
};

/// Result of offering one measurement.
struct Offer {
  bool used = false;
  double residual = 0;  // in the measurement's unit
  double nis = 0;       // its square, in variances
};

/// A plain value: copies of it are the snapshots from which late measurements are replayed.
class MotionFilter {
 public:
  /// scales: as they are known when the first odometer measures. origin_known: the path's distance 0 is the start;
  /// otherwise the place on the map is not known yet.
  MotionFilter(const FusionParameters& parameters, const OdometerScales& scales, int64_t stamp_ns, bool origin_known);

  /// Moves on to the stamp. REQUIRES: not before the current one.
  void predict_to(int64_t stamp_ns, const FusionParameters& parameters);
  /// Moves the clock alone, when it was set; clones lose their meaning and go.
  void rebase_clock(int64_t stamp_ns);

  /// The first odometer that measures; the others are compared with it from then on.
  void choose_unit(Odometer odometer);
  [[nodiscard]] Odometer unit() const { return unit_; }

  /// Remembers the odometer at the current stamp; forgets clones of older pictures but `keep_ns`.
  void clone_now(int64_t keep_ns);
  [[nodiscard]] bool has_clone(int64_t stamp_ns) const { return clone_index(stamp_ns).has_value(); }
  /// That odometer was the first to measure, over so long. Until then the filter knew no speed, and so not what the
  /// scales make of one: speed and the other odometer's way are less sure by that.
  void doubt_first_speed(Odometer measured, double since_s);

  Offer offer_step(int64_t reference_stamp_ns, double step_m, double sigma_m, double gate);
  /// A speed in camera metres.
  Offer offer_speed(double speed_mps, double sigma_mps, double gate);
  Offer offer_wheel(double wheel_m, double sigma_m, double gate);
  Offer offer_acceleration(double accel_mps2, double sigma_mps2, double gate);
  Offer offer_position(const MeasuredPlace& place, double gate);
  /// Would a place with independent errors be used? Changes nothing.
  [[nodiscard]] Offer test_position(double path_distance_m, double sigma_m, double gate) const;
  /// Turning against the map's curvature: where the curvature changes it says where the train is.
  Offer offer_yaw_rate(double rate_rps, double curvature_per_m, double curvature_rate_per_m2, double sigma_rps,
                       double gate);

  /// The wheel's odometer begins anew at this reading (first sample, after slip).
  void restart_wheel(double wheel_m, double sigma_m);
  /// The wheel may have counted so much too much or too little.
  void doubt_wheel(double sigma_m);
  /// The accelerometer's bias may have become another one by sigma.
  void doubt_accel_bias(double sigma_mps2);
  /// What references have told of the way from the begin, and taught of the scale, may be false.
  void forget_references();
  /// The place is not where it was thought: the origin becomes unknown within sigma and the next fix decides.
  void loosen_origin(double sigma_m);
  /// What a false fix taught of the scale of both odometers is forgotten.
  void loosen_scale(const FusionParameters& parameters);
  /// Path distance becomes `path_distance_m`, unknown within sigma, whatever it was.
  void set_origin(double path_distance_m, double sigma_m);

  /// So much more or less time may have gone by than was thought: way and speed are in doubt together.
  void doubt_time(double sigma_s);
  /// The acceleration may have become another one by sigma, up to `since_s` ago.
  void doubt_acceleration(double since_s, double sigma_mps2);
  /// The speed is another one within sigma (unit metres); steps from pictures so far cannot be measured against it.
  void loosen_speed(double sigma_mps);
  /// Takes over another filter's place (distance, path distance and their sigmas) as independent knowledge.
  void place_like(const MotionFilter& other);

  [[nodiscard]] int64_t stamp_ns() const { return stamp_ns_; }
  [[nodiscard]] double value(StateIndex state) const { return x_(index(state)); }
  [[nodiscard]] double sigma(StateIndex state) const;
  [[nodiscard]] double path_distance_m() const { return value(StateIndex::distance) + value(StateIndex::origin); }
  [[nodiscard]] double path_sigma_m() const;
  [[nodiscard]] double speed_mps() const { return unit_scale() * value(StateIndex::speed); }
  /// True over measured metres of an odometer.
  [[nodiscard]] double scale(Odometer odometer) const { return unit_scale() * to_unit(odometer); }
  /// Unit metres over measured metres of an odometer.
  [[nodiscard]] double to_unit(Odometer odometer) const;
  [[nodiscard]] double scale_sigma(Odometer odometer) const;
  [[nodiscard]] OdometerScales scales() const;

 private:
  [[nodiscard]] int index(StateIndex state) const { return static_cast<int>(clones_.size()) + static_cast<int>(state); }
  [[nodiscard]] std::optional<int> clone_index(int64_t stamp_ns) const;
  [[nodiscard]] double unit_scale() const { return 1 + value(StateIndex::unit_scale); }
  [[nodiscard]] estimation::StateVector zero_row() const;
  [[nodiscard]] estimation::StateVector scale_row(Odometer odometer) const;
  /// One step of time: what of every state is kept, and what it adds to others.
  struct Prediction {
    double dt_s = 0;
    double acceleration_keep = 0;
    double speed_per_accel = 0;
    double way_per_accel = 0;
    double way_m = 0;  // in metres of the unit, as counted by ...
    double per_camera = 1;
    double per_wheel = 1;
    double unit_keep = 1;
    double other_keep = 1;
    double unit_noise = 0;
    double other_noise = 0;
    double shape_keep = 1;
    double gnss_keep = 1;
  };
  [[nodiscard]] Prediction prediction(double dt_s, const FusionParameters& p) const;
  [[nodiscard]] estimation::StateMatrix transition(const Prediction& m) const;
  void step(double dt_s, const FusionParameters& parameters);
  void move(const Prediction& m);
  void remove_clone(int index);
  void forget_clones();
  Offer offer(const estimation::StateVector& h, double residual, double sigma, double gate);

  int64_t stamp_ns_ = 0;
  Odometer unit_ = Odometer::none;
  OdometerScales known_before_;
  std::vector<int64_t> clones_;  // their stamps in the order of the states: newest first
  estimation::StateVector x_;
  estimation::UdFilter ud_;
};

}  // namespace railfix::fusion
