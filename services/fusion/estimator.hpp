// One moment of fusion: the motion filter, what is known of each sensor's health, and the state that follows from both.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "core/repeated.hpp"
#include "fusion/felt_motion.hpp"
#include "fusion/fix_outcome.hpp"
#include "fusion/fusion_parameters.hpp"
#include "fusion/fusion_types.hpp"
#include "fusion/gyro_watch.hpp"
#include "fusion/motion_filter.hpp"
#include "fusion/odometer_scales.hpp"
#include "fusion/other_ways.hpp"
#include "fusion/period_mean.hpp"
#include "fusion/rhythm.hpp"
#include "fusion/sensor_watch.hpp"
#include "fusion/slip_watch.hpp"
#include "fusion/standstill.hpp"
#include "fusion/sudden_change.hpp"
#include "fusion/told_place.hpp"
#include "fusion/track_doubt.hpp"
#include "fusion/turned_way.hpp"
#include "fusion/unwatched_way.hpp"
#include "fusion/wheel_odometer.hpp"
#include "fusion/wrong_place.hpp"
#include "track/path.hpp"

namespace railfix::fusion {

/// Where the train is for certain: the two ends on the path (on the distance run when the place is not known).
struct Interval {
  double rear_m = 0;
  double front_m = 0;
};

/// What a fix must know of those beside whom it is used.
struct FixContext {
  /// They promise so much more: a fix that is used must not be weighed against the filter's sigma alone.
  double excess_m = 0;
  /// The interval is asked without widened(): a vague fix leaves what slips may have added as it is, instead of making
  /// it part of what the interval holds.
  bool unwidened = false;
};

/// A plain value; events are applied in the order of their stamps (Fusion sees to that).
class Estimator {
 public:
  /// path: the way of the train with distance 0 at the start; nullptr when the place is not known.
  Estimator(const FusionParameters* parameters, const OdometerScales& scales, std::shared_ptr<const track::Path> path,
            int64_t stamp_ns);

  void apply(const Event& event, const FixContext& context = {});
  /// Moves on without a measurement.
  void predict_to(int64_t stamp_ns);
  void rebase_clock(int64_t stamp_ns);
  /// The same way, which goes on beyond the ends of `path`: nothing else changes.
  void follow_on(const std::shared_ptr<const track::Path>& path, const std::shared_ptr<const track::Path>& longer) {
    if (place_.path == path) place_.path = longer;
  }
  /// Of the sensors that work, without widened().
  [[nodiscard]] Interval interval() const;
  /// With what slips may have added since the reference that no camera watched.
  [[nodiscard]] Interval widened(const Interval& interval) const;
  [[nodiscard]] double centre_m() const { return place_.path ? filter_.path_distance_m() : distance_m(); }
  [[nodiscard]] double sigma_m() const {
    return place_.path ? std::hypot(filter_.path_sigma_m(), parameters_->place_shared_sigma_m)
                       : filter_.sigma(StateIndex::distance);
  }
  [[nodiscard]] double distance_m() const { return filter_.value(StateIndex::distance); }
  static constexpr double kBridgeS = 10.0;  // as long as the IMU alone is good for place and speed
  /// Camera or wheel measured lately and was believed, or the IMU bridges a short while without them.
  [[nodiscard]] bool knows_motion(double bridge_s = kBridgeS) const;
  /// No odometer has measured in the last moments: the IMU alone is left, at best.
  [[nodiscard]] bool in_the_dark() const;
  /// No motion sensor is isolated but those of `excepted` (bits 1 << Source).
  [[nodiscard]] bool is_consistent(uint32_t excepted = 0) const;
  /// Motion sensors that are isolated, a bit each.
  [[nodiscard]] uint32_t isolated() const;
  /// It measured in the last moments and was believed.
  [[nodiscard]] bool measures(Source source) const;
  /// One of these sources is isolated though nothing proves that it is the wrong one.
  [[nodiscard]] bool disputes(std::span<const Source> sources, std::optional<Source> but_for = {}) const;
  [[nodiscard]] bool has_ever_measured(Source source) const { return watch(source).used_ns != 0; }
  /// So many motion sensors measured in the last moments and were believed.
  [[nodiscard]] int sensors_at_work() const;
  /// The IMU feels other motion than the one odometer that is left says.
  [[nodiscard]] bool feels_otherwise() const { return felt_.faster_mps() != 0; }
  /// That sensor is found to be wrong: it is isolated, with what `other` knows of it.
  void exclude(Source source, const Estimator& other);
  /// From now on that sensor's samples do not come here; that it is isolated is no contradiction.
  void do_without(Source source) { watched(source).isolated = watched(source).convicted = false; }
  /// GNSS has agreed with the motion for a while, and with a place that it had not given itself.
  [[nodiscard]] bool gnss_proven() const { return gnss_agreed_ >= kGnssProof && place_.told.by() != ToldBy::gnss; }
  /// What GNSS that agrees with the motion may still be wrong by.
  [[nodiscard]] double gnss_bound_m() const;
  /// Takes over its place, with what is in doubt there, as independent knowledge; speed and scales stay its own.
  void place_like(const Estimator& other);
  /// The train may be so far beyond the interval's ends, until a fix says where it is.
  void doubt_place(const Sides& beyond);
  /// Its last reference lies so far back.
  void refer_back(double since_reference_m);
  /// The state with this promised interval; since_sure_m: way since the last place that is beyond doubt.
  /// REQUIRES: predict_to(stamp_ns()) was the last call (as for interval()).
  [[nodiscard]] TrainEstimate estimate(const Interval& promised, double since_sure_m) const;
  /// Way since the last fix that settled what was in doubt.
  [[nodiscard]] double since_fix_m() const { return std::abs(distance_m() - place_.fix_m); }
  /// ... and since the last one that was sharp enough for the budget to count from.
  [[nodiscard]] double since_reference_m() const { return std::abs(distance_m() - place_.reference_m); }
  /// What became of the last event, when it was a fix.
  [[nodiscard]] const FixOutcome& fix() const { return fix_; }
  [[nodiscard]] int landmarks_agreed() const { return place_.told.landmarks_agreed(); }

  /// When the last event showed that the wheel slips: what it said since a little before is best taken back.
  [[nodiscard]] bool slip_began() const { return slip_began_; }
  /// Wheel samples of that time are not to be used.
  void block_wheel(const WheelBlock& block);

  /// Of the last event. The filter itself may be a little behind, because samples wait for their mean.
  [[nodiscard]] int64_t stamp_ns() const { return stamp_ns_; }
  [[nodiscard]] const MotionFilter& filter() const { return filter_; }
  [[nodiscard]] const SensorWatch& watch(Source source) const { return watches_[static_cast<size_t>(source)]; }
  [[nodiscard]] bool knows_picture(int64_t stamp_ns) const { return filter_.has_clone(stamp_ns); }
  [[nodiscard]] const std::shared_ptr<const track::Path>& path() const { return place_.path; }
  /// The place is to be given up: where the train is, nobody knows any more.
  [[nodiscard]] std::optional<Against> place_is_wrong() const { return place_.wrong_place.proven(); }
  void give_place_up(Against because);
  /// Who spoke against the last place; nothing where there is one, or was none yet.
  [[nodiscard]] std::optional<Against> given_up() const { return place_.given_up; }

 private:
  /// The wheel's odometer and its recovery from slip.
  struct Wheel {
    WheelOdometer odometer;
    std::vector<WheelBlock> blocks;
    int64_t counts_since_ns = 0;
    bool on_trial = false;  // had slipped, and was taken back in the dark on the word of an IMU alone
    int64_t window_begin_ns = 0;
    std::optional<double> window_m;  // its reading then
    int good_windows = 0;
    bool camera_agrees = false;  // over the last second, and it turned
  };
  static constexpr int kGnssProof = 30;
  static constexpr double kLatelyS = 1.0;
  static constexpr double kBlindS = 0.3;  // the camera
  struct RefusedFix {
    double residual_m = 0;
    double sigma_m = 0;
    double distance_m = 0;
  };
  /// What is known of the place on the map, beside the filter's numbers.
  struct Place {
    std::shared_ptr<const track::Path> path;  // nullptr = the place is not known
    std::optional<Against> given_up;          // the last place was, and there is none since
    ToldPlace told;
    TrackDoubt track_doubt;
    TurnedWay turned_way;
    WrongPlace wrong_place;
    uint32_t reference = 0;
    double fix_m = 0;                // the distance run at the last fix that settled what was in doubt ...
    double reference_m = 0;          // ... and at the reference
    std::array<uint32_t, 16> met{};  // landmarks that were used last, newest first; 0 = none
    OtherWays other_ways;
  };
  /// What is in doubt until a fix is used.
  struct Doubts {
    double odometers_m = 0;  // camera and the rest contradict each other by so much
    Sides gnss;              // GNSS that contradicts a wheel alone says that the train is so far away
    Sides refused;           // a fix that was refused, or a surprising one, says that the train is so far away
  };

  [[nodiscard]] bool used_within(Source source, double time_s) const;
  /// The camera is not blind, and believed.
  [[nodiscard]] bool sees() const { return used_within(Source::camera, kBlindS); }
  void doubt_time(const SensorWatch& watch, Rhythm& rhythm, int64_t stamp_ns);
  void notice_gap(int64_t stamp_ns);
  /// Offered again as a sudden change of acceleration when it is refused.
  Offer offer_motion(Source source, int64_t stamp_ns, const std::function<Offer(MotionFilter&)>& offering);
  void use(const OdometryInput& step);
  void use(const WheelInput& sample);
  void use(const ImuInput& sample);
  void use(const GnssInput& sample);
  void use(const FixInput& fix);
  void use(const PictureInput& picture);
  void use_acceleration(double accel_mps2, int64_t stamp_ns);
  void feel(double accel_mps2, double sigma_mps2, int64_t before_ns);
  void doubt_grade();
  void compare_with_wheel(const OdometryInput& step, double sigma_m);
  void isolate_wheel();
  bool blame_wheel_on_trial();
  [[nodiscard]] bool nobody_measured() const {
    return !has_ever_measured(Source::camera) && !has_ever_measured(Source::wheel);
  }
  void doubt_silent_wheel(int64_t silent_since_ns, double way_m);
  void watch_alone(double way_m, double dt_s);
  [[nodiscard]] bool is_watched() const;
  [[nodiscard]] bool slipped_unseen() const;
  [[nodiscard]] bool wheel_is_alone() const;
  [[nodiscard]] double unwatched_share() const;
  void restart_wheel(int64_t stamp_ns, double wheel_m, double sigma_m);
  void take_wheel_back(int64_t stamp_ns, double wheel_m, double sigma_m);
  void recover_wheel(const WheelInput& sample, double wheel_m, double sigma_m);
  void use_yaw_rate(double rate_rps);
  /// Whether it is believed.
  bool judge_gyro(double rate_rps);
  void remember_turn(double rate_rps, double speed_mps);
  void compare_turns();
  /// GNSS, which has never agreed with it, says otherwise, and hardly anything speaks for it.
  [[nodiscard]] bool gnss_denies_place() const;
  /// That end of its path.
  [[nodiscard]] bool may_be_beyond(double end_m) const;
  [[nodiscard]] bool is_off_map() const;
  void hold_gnss(double foot_m, double sigma_m);
  void use_track(const FixInput& fix);
  void doubt_points_behind();
  [[nodiscard]] bool fits_a_named_way(const MeasuredPlace& place) const;
  Offer offer_place(const MeasuredPlace& place);
  Offer offer_place_again(double path_distance_m, double sigma_m);
  [[nodiscard]] bool has_met(uint32_t landmark) const;
  /// What the interval reaches to either side where nothing is in doubt.
  [[nodiscard]] double known_to_m() const;
  /// ... and where the train is lost.
  [[nodiscard]] double lost_to_m() const;
  /// What the promised interval holds more.
  [[nodiscard]] double doubted_beyond_sigma_m() const;
  /// So far away may the train be by a fix.
  [[nodiscard]] double reach_m(const Offer& offer, double sigma_m) const;
  void doubt_surprise(double sigma_m);
  void refuse(const FixInput& fix, double path_distance_m, const Offer& offer);
  void accept(const FixInput& fix);
  void mark_reference(const FixInput& fix);
  SensorWatch& watched(Source source) { return watches_[static_cast<size_t>(source)]; }
  [[nodiscard]] bool silent(Source source) const;
  [[nodiscard]] double unused_for_s(Source source) const;
  void judge(TrainEstimate& estimate) const;
  void judge_sensors(TrainEstimate& estimate) const;
  void judge_place(TrainEstimate& estimate) const;
  void judge_bounds(TrainEstimate& estimate) const;
  void locate(TrainEstimate& estimate) const;

  const FusionParameters* parameters_;
  MotionFilter filter_;
  int64_t stamp_ns_;
  int64_t start_ns_ = 0;

  // Motion, and who is believed about it.
  std::array<SensorWatch, kSources> watches_;
  Rhythm pictures_;
  Rhythm pulses_;
  DataGap gap_;
  PeriodMean accel_;
  core::Repeated accel_repeated_;
  bool grade_known_ = true;
  double graded_m_ = 0;  // the distance up to which the bias allows for a grade that is not known
  PeriodMean yaw_;
  GyroWatch gyro_watch_;
  double judged_m_ = 0;  // the distance at which its mean began
  Wheel wheel_;
  FeltMotion felt_;
  SlipWatch slip_watch_;
  SuddenChange sudden_change_;
  bool slip_began_ = false;
  Standstill standstill_;

  // The place, and the fixes that told it.
  Place place_;
  FixOutcome fix_;  // of the last event
  std::optional<RefusedFix> refused_fix_;
  std::optional<track::EdgePosition> off_path_;  // a fix was there since the last one that was used
  bool corrected_ = false;                       // the place was moved against the filter's word, not confirmed yet
  int gnss_agreed_ = 0;                          // fixes, since three in a row were refused or one had no place
  bool gnss_was_proven_ = false;                 // when three in a row were

  // What the interval holds beyond the filter's sigma.
  Doubts doubts_;
  UnwatchedWay unwatched_;
  double unchecked_m_ = 0;  // of the first step, until a second one or the wheel agrees
  FixContext context_;      // of the present event
};

}  // namespace railfix::fusion
