// One moment of fusion: how the train moves, where on the map it is, and the state that follows from both.
#pragma once

#include <cstdint>
#include <memory>

#include "fusion/fusion_parameters.hpp"
#include "fusion/fusion_types.hpp"
#include "fusion/map_place.hpp"
#include "fusion/odometer_scales.hpp"
#include "fusion/train_motion.hpp"
#include "track/path.hpp"

namespace railfix::fusion {

/// A plain value; events are applied in the order of their stamps (Fusion sees to that).
class Estimator {
 public:
  /// path: the way of the train with distance 0 at the start; nullptr when the place is not known.
  Estimator(const FusionParameters* parameters, const OdometerScales& scales, std::shared_ptr<const track::Path> path,
            int64_t stamp_ns);

  void apply(const Event& event, const FixContext& context = {});
  /// Moves on without a measurement.
  void predict_to(int64_t stamp_ns) { motion_.predict_to(stamp_ns); }
  void rebase_clock(int64_t stamp_ns);
  /// The same way, which goes on beyond the ends of `path`: nothing else changes.
  void follow_on(const std::shared_ptr<const track::Path>& path, const std::shared_ptr<const track::Path>& longer) {
    place_.follow_on(path, longer);
  }

  /// Of the sensors that work, without widened().
  [[nodiscard]] Interval interval() const { return place_.interval(motion_); }
  /// With what slips may have added since the reference that no camera watched.
  [[nodiscard]] Interval widened(const Interval& interval) const { return place_.widened(interval, motion_); }
  [[nodiscard]] double centre_m() const { return place_.centre_m(motion_); }
  /// Way since the last fix that settled what was in doubt ...
  [[nodiscard]] double since_fix_m() const { return place_.since_fix_m(motion_); }
  /// ... and since the last one that was sharp enough for the budget to count from.
  [[nodiscard]] double since_reference_m() const { return place_.since_reference_m(motion_); }
  /// What GNSS that agrees with the motion may still be wrong by.
  [[nodiscard]] double gnss_bound_m() const { return place_.gnss_bound_m(motion_); }
  /// The state with this promised interval; since_sure_m: way since the last place that is beyond doubt.
  /// REQUIRES: predict_to(stamp_ns()) was the last call (as for interval()).
  [[nodiscard]] TrainEstimate estimate(const Interval& promised, double since_sure_m) const;

  /// That sensor is found to be wrong: it is isolated, with what `other` knows of it.
  void exclude(Source source, const Estimator& other);
  /// From now on that sensor's samples do not come here; that it is isolated is no contradiction.
  void do_without(Source source);
  /// Wheel samples of that time are not to be used.
  void block_wheel(const WheelBlock& block) { motion_.block_wheel(block); }
  /// Takes over its place, with what is in doubt there, as independent knowledge; speed and scales stay its own.
  void place_like(const Estimator& other);
  /// The train may be so far beyond the interval's ends, until a fix says where it is.
  void doubt_place(const Sides& beyond) { place_.doubt(beyond, motion_); }
  /// Its last reference lies so far back.
  void refer_back(double since_reference_m) { place_.refer_back(since_reference_m, motion_); }
  /// Where the train is, nobody knows any more.
  void give_place_up(Against because);

  [[nodiscard]] const TrainMotion& motion() const { return motion_; }
  [[nodiscard]] const MapPlace& place() const { return place_; }
  [[nodiscard]] const MotionSensors& sensors() const { return motion_.sensors(); }
  [[nodiscard]] const MotionFilter& filter() const { return motion_.filter(); }
  [[nodiscard]] const SensorWatch& watch(Source source) const;
  /// What became of the last event, when it was a fix.
  [[nodiscard]] const FixOutcome& fix() const { return place_.fix(); }
  /// Of the last event. The filter itself may be a little behind, because samples wait for their mean.
  [[nodiscard]] int64_t stamp_ns() const { return motion_.stamp_ns(); }

 private:
  void use(const ImuInput& sample);
  void use(const GnssInput& sample);
  void use(const FixInput& fix, const FixContext& context);
  void locate(TrainEstimate& estimate) const;
  void judge_sensors(TrainEstimate& estimate) const;
  void judge_place(TrainEstimate& estimate) const;
  void judge_told(TrainEstimate& estimate) const;
  void judge_bounds(TrainEstimate& estimate) const;

  const FusionParameters* parameters_;
  TrainMotion motion_;
  MapPlace place_;
};

}  // namespace railfix::fusion
