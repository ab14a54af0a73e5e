// How the train moves, and who of camera, wheel and IMU is believed about it where they contradict each other. Of the
// place it needs the track's grade and curvature alone; what is wrong with a sensor it finds without any place.
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <vector>

#include "core/repeated.hpp"
#include "fusion/felt_motion.hpp"
#include "fusion/fusion_parameters.hpp"
#include "fusion/fusion_types.hpp"
#include "fusion/gyro_watch.hpp"
#include "fusion/motion_filter.hpp"
#include "fusion/motion_sensors.hpp"
#include "fusion/odometer_scales.hpp"
#include "fusion/period_mean.hpp"
#include "fusion/rhythm.hpp"
#include "fusion/slip_watch.hpp"
#include "fusion/standstill.hpp"
#include "fusion/sudden_change.hpp"
#include "fusion/unwatched_way.hpp"
#include "fusion/wheel_odometer.hpp"
#include "track/path.hpp"

namespace railfix::fusion {

/// What the gyro says over one of its periods, which ends now.
struct YawRate {
  double rps = 0;
  bool believed = false;
  bool just_failed = false;  // it had been believed: what it said of the track is to be forgotten
};

/// A plain value; events are applied in the order of their stamps.
class TrainMotion {
 public:
  static constexpr double kCurvatureSigmaM = 30.0;  // of a place within which the curvature may be taken as linear

  TrainMotion(const FusionParameters* parameters, const OdometerScales& scales, int64_t stamp_ns, bool place_known);

  /// A sample of any sensor comes: before it is used.
  void begin(int64_t stamp_ns);
  /// Moves on without a measurement.
  void predict_to(int64_t stamp_ns);
  void rebase_clock(int64_t stamp_ns);
  void use(const PictureInput& picture);
  void use(const OdometryInput& step);
  void use(const WheelInput& sample);
  /// Gives what the gyro says when its period is complete. path: nullptr where the place is not known.
  std::optional<YawRate> use(const ImuInput& sample, const track::Path* path);
  /// After each event.
  void watch_standstill();
  /// A fix has moved the train, not its motion.
  void moved(double by_m) { standstill_.corrected(by_m); }

  /// That sensor is found to be wrong: it is isolated, with what `other` knows of it.
  void exclude(Source source, const TrainMotion& other);
  /// Its samples do not come here any more; that it is isolated is no contradiction.
  void do_without(Source source) { sensors_[source].leave_out(); }
  /// Wheel samples of that time are not to be used.
  void block_wheel(const WheelBlock& block);
  /// Takes over where the other one has the train, with what is in doubt there; speed and scales stay its own.
  void place_like(const TrainMotion& other);
  /// A fix says how far the train has run: nothing of that is in doubt any more ...
  void settle_doubts();
  /// ... nor what nobody has watched.
  void settle_unwatched() { unwatched_.settle(); }
  /// The fixes so far may have been false.
  void forget_references() { filter_.forget_references(); }

  [[nodiscard]] const MotionFilter& filter() const { return filter_; }
  [[nodiscard]] MotionFilter& filter() { return filter_; }  // a place corrects it, too
  [[nodiscard]] const MotionSensors& sensors() const { return sensors_; }
  [[nodiscard]] const GyroWatch& gyro() const { return gyro_.watch; }
  [[nodiscard]] bool wheel_scatters() const { return wheel_odometer_.scatters(); }
  /// Of the last event. The filter itself may be a little behind, because samples wait for their mean.
  [[nodiscard]] int64_t stamp_ns() const { return stamp_ns_; }
  [[nodiscard]] double distance_m() const { return filter_.value(StateIndex::distance); }
  [[nodiscard]] bool stands() const { return standstill_.stands(); }
  /// The last event showed that the wheel slips: what it said since a little before is best taken back.
  [[nodiscard]] bool slip_began() const { return slip_began_; }
  /// The IMU feels other motion than the one odometer that is left says.
  [[nodiscard]] bool feels_otherwise() const { return felt_.faster_mps() != 0; }

  /// What the interval holds for the motion: camera and the rest contradict each other by so much, ...
  [[nodiscard]] double odometers_apart_m() const { return odometers_apart_m_; }
  /// ... nothing has confirmed yet so much of the first step, ...
  [[nodiscard]] double unchecked_m() const { return unchecked_m_; }
  /// ... time without data may be no time but a clock that was set, ...
  [[nodiscard]] double gap_m() const { return gap_.way_m(); }
  /// ... since the last sample the train may have stopped counting, or the clock may have run ahead, ...
  [[nodiscard]] double silent_m() const;
  /// ... and nobody watches the odometer that is left.
  [[nodiscard]] Sides unwatched() const { return unwatched_.may_be_off(*parameters_); }

 private:
  /// How the wheel recovers from slip.
  struct Wheel {
    std::vector<WheelBlock> blocks;
    int64_t counts_since_ns = 0;
    bool on_trial = false;  // had slipped, and was taken back in the dark on the word of an IMU alone
    int64_t window_begin_ns = 0;
    std::optional<double> window_m;  // its reading then
    int good_windows = 0;
    bool camera_agrees = false;  // over the last second, and it turned
  };
  struct Accelerometer {
    PeriodMean mean;
    core::Repeated repeated;
    bool grade_known = true;
    double graded_m = 0;  // the distance up to which the bias allows for a grade that is not known
  };
  struct Gyro {
    PeriodMean mean;
    double begin_m = 0;  // the distance at which it began
    GyroWatch watch;
  };

  /// Offered again as a sudden change of acceleration when it is refused.
  Offer offer(Source source, int64_t stamp_ns, const std::function<Offer(MotionFilter&)>& offering);
  void doubt_time(Source source, Rhythm& rhythm, int64_t stamp_ns);

  void use_valid(const OdometryInput& step);
  void accept_step(const OdometryInput& step, double sigma_m);
  void refuse_step(int64_t stamp_ns, double off_m, bool alone);
  void compare_with_wheel(const OdometryInput& step, double sigma_m);
  bool blame_wheel_on_trial();

  void use_reading(int64_t stamp_ns, const WheelReading& reading, int64_t before_ns);
  void isolate_wheel();
  void doubt_silent_wheel(int64_t silent_since_ns, double way_m);
  void watch_alone(double way_m, double dt_s);
  [[nodiscard]] bool is_watched() const;
  [[nodiscard]] bool slipped_unseen() const;
  [[nodiscard]] bool wheel_is_alone() const;
  [[nodiscard]] double unseen_share() const;
  void restart_wheel(int64_t stamp_ns, const WheelReading& reading);
  void take_wheel_back(int64_t stamp_ns, const WheelReading& reading);
  void recover_wheel(int64_t stamp_ns, const WheelReading& reading);

  void use_acceleration(double accel_mps2, int64_t stamp_ns, const track::Path* path);
  void doubt_grade(const track::Path* path);
  void feel(double accel_mps2, double sigma_mps2, int64_t before_ns);
  [[nodiscard]] YawRate judge_gyro(double rate_rps, const track::Path* path);

  const FusionParameters* parameters_;
  MotionFilter filter_;
  MotionSensors sensors_;
  int64_t stamp_ns_;
  Rhythm pictures_;
  Rhythm pulses_;
  DataGap gap_;
  SuddenChange sudden_change_;
  Standstill standstill_;

  WheelOdometer wheel_odometer_;
  Wheel wheel_;
  SlipWatch slip_watch_;
  bool slip_began_ = false;
  UnwatchedWay unwatched_;
  Accelerometer accelerometer_;
  FeltMotion felt_;
  Gyro gyro_;

  double odometers_apart_m_ = 0;
  double unchecked_m_ = 0;  // of the first step, until a second one or the wheel agrees
};

}  // namespace railfix::fusion
