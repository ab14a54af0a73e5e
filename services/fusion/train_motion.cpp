#include "fusion/train_motion.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "core/time.hpp"

namespace railfix::fusion {
namespace {

constexpr double kRebaseS = 0.1;  // lost when the clock is set
constexpr double kFreshS = 0.12;

}  // namespace

TrainMotion::TrainMotion(const FusionParameters* parameters, const OdometerScales& scales, int64_t stamp_ns,
                         bool place_known)
    : parameters_(parameters),
      filter_(*parameters, scales, stamp_ns, place_known),
      sensors_(stamp_ns),
      stamp_ns_(stamp_ns),
      standstill_(stamp_ns) {}

void TrainMotion::begin(int64_t stamp_ns) {
  slip_began_ = false;
  if (stamp_ns <= stamp_ns_) return;
  const double since_s = core::seconds(stamp_ns - stamp_ns_);
  for (auto* rhythm : {&pictures_, &pulses_}) rhythm->pause(since_s);
  gap_.add(stamp_ns_, stamp_ns, filter_.speed_mps());
  stamp_ns_ = stamp_ns;
}

void TrainMotion::predict_to(int64_t stamp_ns) {
  filter_.predict_to(stamp_ns, *parameters_);
  sensors_.move_to(filter_.stamp_ns());
}

void TrainMotion::rebase_clock(int64_t stamp_ns) {
  filter_.rebase_clock(stamp_ns);
  filter_.doubt_time(kRebaseS);
  sensors_.set_clock(stamp_ns);
  stamp_ns_ = stamp_ns;
  accelerometer_.mean = {};
  gyro_.mean = {};
  gyro_.watch.set_clock(stamp_ns);
  wheel_.blocks.clear();
  wheel_.window_begin_ns = 0;
  wheel_.counts_since_ns = std::min(wheel_.counts_since_ns, stamp_ns);
  gap_.set_clock(stamp_ns);
  slip_watch_ = {};
  sudden_change_ = {};
  standstill_.set_clock(stamp_ns);
}

void TrainMotion::watch_standstill() {
  standstill_.look(distance_m(), filter_.sigma(StateIndex::speed), stamp_ns_);
}

double TrainMotion::silent_m() const {
  const double silent_s = core::seconds(filter_.stamp_ns() - stamp_ns_);
  return silent_s > kFreshS ? std::abs(filter_.speed_mps()) * silent_s : 0;
}

void TrainMotion::settle_doubts() {
  odometers_apart_m_ = 0;
  gap_.settle();
}

void TrainMotion::place_like(const TrainMotion& other) {
  filter_.place_like(other.filter_);
  odometers_apart_m_ = other.odometers_apart_m_;
  gap_.hold(other.gap_.way_m());
  unwatched_.go_on_from(other.unwatched_);
}

void TrainMotion::exclude(Source source, const TrainMotion& other) {
  sensors_[source] = other.sensors_[source];
  sensors_[source].convict(stamp_ns_);
  slip_began_ = false;
  if (source == Source::camera) pictures_ = other.pictures_;
  if (source == Source::imu) {
    accelerometer_.repeated = other.accelerometer_.repeated;
    gyro_.watch = other.gyro_.watch;
  }
  if (source != Source::wheel) return;
  pulses_ = other.pulses_;
  wheel_odometer_.go_on_from(other.wheel_odometer_);
  wheel_ = other.wheel_;
  wheel_.good_windows = 0;
  wheel_.window_begin_ns = filter_.stamp_ns();
  wheel_.window_m.reset();
}

Offer TrainMotion::offer(Source source, int64_t stamp_ns, const std::function<Offer(MotionFilter&)>& offering) {
  const Offer offer = offering(filter_);
  if (offer.used) {
    sudden_change_.agreed(source, stamp_ns);
    return offer;
  }
  MotionFilter changed = filter_;
  changed.doubt_acceleration(sudden_change_.since_s(stamp_ns), SuddenChange::kSigmaMps2);
  const Offer again = offering(changed);
  if (!again.used || !sudden_change_.called(source, stamp_ns, offer.residual > 0)) return offer;
  filter_ = std::move(changed);
  return again;
}

// A sample that comes out of rhythm may have another clock behind it: then what was predicted by time alone is in doubt
// by as much, and the sample itself says how far the train ran.
void TrainMotion::doubt_time(Source source, Rhythm& rhythm, int64_t stamp_ns) {
  const int64_t before_ns = sensors_[source].seen_ns;
  if (before_ns == 0 || stamp_ns <= before_ns) return;
  const double off_s = rhythm.add(core::seconds(stamp_ns - before_ns));
  if (off_s > 0) filter_.doubt_time(off_s);
}

}  // namespace railfix::fusion
