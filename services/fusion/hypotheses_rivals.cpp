// Rivals: the estimates without camera, without wheel, without IMU and without GNSS.
#include <algorithm>
#include <cmath>
#include <utility>

#include "core/time.hpp"
#include "fusion/hypotheses.hpp"

namespace railfix::fusion {
namespace {

constexpr double kRivalGoneS = 1.0;
constexpr double kProofS = 2.0;
constexpr double kSameSpeedsS = 3.0;
constexpr double kUnwatchedWheelS = 60.0;

}  // namespace

// Main contradicts itself, without one certain sensor two others have agreed for a while, and without any other sensor
// the contradiction stays: that sensor is wrong. A rival that has only little left to say does not contradict itself
// and leaves the matter open.
void Hypotheses::exclude_faulty() {
  const int64_t now_ns = main_.filter().stamp_ns();
  Rival* proven = nullptr;
  int consistent = 0;
  for (auto& rival : rivals_) {
    if (!rival.estimator || rival.without == Source::gnss) continue;
    const bool agrees = rival.estimator->sensors().are_consistent();
    consistent += agrees ? 1 : 0;
    const bool proves =
        agrees && rival.estimator->sensors().at_work() >= 2 && !rival.estimator->motion().feels_otherwise();
    if (!proves || rival.proven_since_ns == 0) rival.proven_since_ns = proves ? now_ns : 0;
    if (proves && core::seconds(now_ns - rival.proven_since_ns) >= kProofS) proven = &rival;
  }
  if (proven == nullptr || consistent > 1 || main_.sensors().are_consistent()) return;
  // Nothing is left to prove when that sensor alone is isolated.
  if (main_.sensors().are_consistent(1U << static_cast<unsigned>(proven->without))) return;
  Estimator next = without_faulty(*proven);
  for (auto& doubter : doubters_) {
    if (!doubter.estimator.sensors().are_consistent()) take_along(doubter, next);
  }
  adopt(*proven, std::move(next));
}

// What the rival knows, with the sensor that it does without found to be wrong.
Estimator Hypotheses::without_faulty(const Rival& rival) const {
  Estimator next = *rival.estimator;
  next.exclude(rival.without, main_);
  return next;
}

void Hypotheses::adopt(Rival& rival, Estimator next) {
  Sides said = rival.carried;
  said.add(rival.unseen);
  next.doubt_place(said);
  main_ = std::move(next);
  for (auto& other : rivals_) other.forget_excess();
}

// A doubter that went by the sensor which is wrong goes by the others from now on, and what it held stays, and what it
// did without is no surer now.
void Hypotheses::take_along(Doubter& doubter, const Estimator& next) const {
  Estimator own = doubter.estimator;
  own.predict_to(main_.filter().stamp_ns());
  const Sides more = beyond(main_.interval(), own.interval());
  doubter.estimator = next;
  doubter.estimator.doubt_place(more);
  doubter.estimator.refer_back(own.since_reference_m());
}

void Hypotheses::confirm_rivals() {
  for (auto& rival : rivals_) {
    rival.forget_excess();
    // Confirmed is the main one: a rival that is elsewhere was wrong.
    if (!rival.estimator || !rival.estimator->fix().refused()) continue;
    if (stands_for_another(rival)) {
      rival.estimator->place_like(main_);
    } else {
      begin_again(rival);
    }
  }
  ask_rivals();
}

void Hypotheses::begin_rival(Source source) {
  for (auto& rival : rivals_) {
    if (rival.without != source || rival.estimator) continue;
    rival.estimator = main_;
    // A first sample that is used at once finds it there, not away.
    if (main_.sensors().know_motion()) rival.asked_ns = main_.filter().stamp_ns();
  }
}

void Hypotheses::ask_rivals() {
  for (auto& rival : rivals_) ask(rival);
}

void Hypotheses::ask(Rival& rival) {
  const int64_t now_ns = main_.filter().stamp_ns();
  if (!can_say(rival)) {
    rival.asked = false;
    if (!rival.estimator) return;
    const bool consistent = !contradicts_itself(rival);
    // What the main one has not used yet the rival does not lack: it is not away.
    if (main_.watch(rival.without).used_ns == 0 && rival.estimator->sensors().know_motion()) rival.asked_ns = now_ns;
    if (consistent && core::seconds(now_ns - rival.asked_ns) < kSameSpeedsS) extrapolate(rival, now_ns);
    rival.contradicted = rival.contradicted || !consistent;
    if (rival.contradicted && main_is_sound_without(rival.without)) begin_again(rival);
    return;
  }
  auto& other = *rival.estimator;
  if (!rival.asked && core::seconds(now_ns - rival.asked_ns) > kRivalGoneS) {
    // It was away: it begins again where the main one is, and what it had said before stays.
    lose_sight(rival, now_ns);
    // A train without camera may have nothing but the rival's wheel.
    if (rival.contradicted && (main_.sensors().know_motion() || main_.watch(Source::camera).seen_ns != 0)) {
      begin_again(rival);
    } else {
      other.place_like(main_);
      rival.carried = rival.excess;
    }
  }
  rival.contradicted = false;
  rival.asked = true;
  rival.asked_ns = now_ns;
  if (is_in_dispute(rival)) {  // its end will say nothing about the way before it
    rival.carried.add(std::exchange(rival.unseen, {}));
  }
  other.predict_to(now_ns);
  const Interval mine = main_.interval();
  Interval its = other.interval();
  double apart_m = other.centre_m() - main_.centre_m();
  if (rival.without == Source::gnss && main_.place().gnss_proven()) {
    const double most_m = main_.gnss_bound_m();
    apart_m = std::clamp(apart_m, -most_m, most_m);
    its.rear_m = std::max(its.rear_m, mine.rear_m - most_m);
    its.front_m = std::min(its.front_m, mine.front_m + most_m);
  }
  // Since it came back both have gone on from one place: how far they come apart since adds to what it had said before.
  rival.excess = rival.carried;
  rival.excess.add({std::max(0.0, -apart_m), std::max(0.0, apart_m)});
  rival.excess.hold(beyond(mine, its));
  rival.faster_mps = other.filter().speed_mps() - main_.filter().speed_mps();
  rival.excess_ns = now_ns;
}

bool Hypotheses::can_say(const Rival& rival) const {
  // Nobody watches an IMU in the dark: what the train may do is known without it, too.
  if (rival.without == Source::imu && rival.estimator && main_.sensors().in_the_dark())
    return rival.estimator->sensors().are_consistent(main_.sensors().isolated());
  // What the IMU alone leaves open beside a wheel is more and more, but all that a wheel may hide which nobody watches.
  const double bridge_s = rival.without == Source::wheel ? kUnwatchedWheelS : MotionSensors::kBridgeS;
  return rival.estimator && main_.watch(rival.without).used_ns != 0 &&
         rival.estimator->sensors().know_motion(bridge_s) && !contradicts_itself(rival);
}

// The one without GNSS has the main one's motion sensors: what that has isolated is no contradiction here.
bool Hypotheses::contradicts_itself(const Rival& rival) const {
  return !rival.estimator->sensors().are_consistent(rival.without == Source::gnss ? main_.sensors().isolated() : 0);
}

// Nothing contradicts anything, and another odometer measures: a rival that has lost its way may begin again, so that
// it knows its own when it is needed.
bool Hypotheses::main_is_sound_without(Source source) const {
  return main_.sensors().are_consistent() && std::ranges::any_of(kOdometers, [&](Source odometer) {
           return odometer != source && main_.sensors().measures(odometer);
         });
}

// Two sensors agree in it, of which the main one has left one out without proof: should it begin again, nobody would
// speak for that sensor.
bool Hypotheses::stands_for_another(const Rival& rival) const {
  return rival.proven_since_ns != 0 && main_.sensors().dispute(kMotionSources, rival.without);
}

// What it had said before stays.
void Hypotheses::begin_again(Rival& rival) const {
  rival.estimator = main_;
  rival.estimator->do_without(rival.without);
  rival.carried = rival.excess;
}

// It takes over a place that the main one has counted by the very sensor that this rival doubts: should that prove
// wrong, the train is where the rival's own reckoning allows.
void Hypotheses::lose_sight(Rival& rival, int64_t now_ns) const {
  Estimator own = *rival.estimator;
  own.predict_to(now_ns);
  rival.unseen.hold(beyond(main_.widened(main_.interval()), own.interval()));
}

// Nothing tells any more how far they come apart: for a while as fast as they did last.
void Hypotheses::extrapolate(Rival& rival, int64_t now_ns) {
  const double apart_m = rival.faster_mps * core::seconds(now_ns - std::exchange(rival.excess_ns, now_ns));
  rival.excess.add({std::max(0.0, -apart_m), std::max(0.0, apart_m)});
}

// Of two odometers the main one has isolated, without proof, the one that the rival believes.
bool Hypotheses::is_in_dispute(const Rival& rival) const {
  return main_.sensors().dispute(kOdometers, rival.without);
}

Sides Hypotheses::beyond(const Interval& mine, const Interval& its) {
  return {mine.rear_m - its.rear_m, its.front_m - mine.front_m};
}

Sides Hypotheses::most_excess() const {
  Sides most;
  for (const auto& rival : rivals_) most.hold(rival.excess);
  return most;
}

Interval Hypotheses::promised(const Interval& main) const {
  const Sides most = most_excess();
  return {main.rear_m - most.behind_m, main.front_m + most.ahead_m};
}

}  // namespace railfix::fusion
