#include "fusion/hypotheses.hpp"

#include <algorithm>
#include <cmath>
#include <functional>
#include <iterator>
#include <utility>

#include "core/time.hpp"
#include "fusion/jump_evidence.hpp"

namespace railfix::fusion {
namespace {

constexpr int kFixesToSettle = 2;
constexpr int kFixesOfAClaim = 2;  // move the train against the filter
constexpr double kSureFix = 0.99;
constexpr double kRivalGoneS = 1.0;
constexpr double kProofS = 2.0;
constexpr double kSameSpeedsS = 3.0;

Source source_of(const Event& event) {
  if (std::holds_alternative<ImuInput>(event)) return Source::imu;
  if (std::holds_alternative<WheelInput>(event)) return Source::wheel;
  if (std::holds_alternative<GnssInput>(event)) return Source::gnss;
  if (std::holds_alternative<FixInput>(event)) return Source::landmark;
  return Source::camera;
}

// A landmark that is named by those before it may be wrong because one of them is.
bool told_by_others(const FixInput& fix) {
  return fix.kind != FixKind::curvature && !fix.new_path && fix.probability < kSureFix;
}

}  // namespace

void Promise::hold(const Promise& other) {
  interval.behind_m = std::min(interval.behind_m, other.interval.behind_m);
  interval.ahead_m = std::max(interval.ahead_m, other.interval.ahead_m);
  since_sure_m = std::max(since_sure_m, other.since_sure_m);
}

Hypotheses::Hypotheses(const FusionParameters* parameters, const OdometerScales& scales,
                       std::shared_ptr<const track::Path> path, int64_t stamp_ns)
    : parameters_(parameters),
      main_(parameters, scales, std::move(path), stamp_ns),
      rivals_{Rival{Source::camera, {}, {}, {}, {}}, Rival{Source::wheel, {}, {}, {}, {}},
              Rival{Source::imu, {}, {}, {}, {}}, Rival{Source::gnss, {}, {}, {}, {}}} {}

void Hypotheses::apply(const Event& event) {
  fix_fitted_.reset();
  const auto* fix = std::get_if<FixInput>(&event);
  if (fix != nullptr && fix->kind != FixKind::track) {
    apply_fix(*fix, event);
    return;
  }
  const Source source = source_of(event);
  begin_rival(source);
  main_.apply(event);
  for (auto& doubter : doubters_) doubter.estimator.apply(event);
  for (auto& rival : rivals_) {
    if (rival.estimator && rival.without != source) rival.estimator->apply(event);
  }
  if (source == Source::camera || source == Source::wheel) {
    exclude_faulty();
    ask_rivals();
  }
}

// Main contradicts itself, without one certain sensor two others have agreed for a while, and without any other sensor
// the contradiction stays: that sensor is wrong. A rival that has only little left to say does not contradict itself
// and leaves the matter open.
void Hypotheses::exclude_faulty() {
  const int64_t now_ns = main_.filter().stamp_ns();
  Rival* proven = nullptr;
  int consistent = 0;
  for (auto& rival : rivals_) {
    if (!rival.estimator || rival.without == Source::gnss) continue;
    const bool agrees = rival.estimator->is_consistent();
    consistent += agrees ? 1 : 0;
    const bool proves = agrees && rival.estimator->sensors_at_work() >= 2;
    if (!proves || rival.proven_since_ns == 0) rival.proven_since_ns = proves ? now_ns : 0;
    if (proves && core::seconds(now_ns - rival.proven_since_ns) >= kProofS) proven = &rival;
  }
  if (proven == nullptr || consistent > 1 || main_.is_consistent()) return;
  // Nothing is left to prove when that sensor alone is isolated.
  if (main_.is_consistent(1U << static_cast<unsigned>(proven->without))) return;
  adopt(*proven);
}

void Hypotheses::adopt(Rival& rival) {
  Estimator next = *rival.estimator;
  next.exclude(rival.without, main_);
  next.doubt_place(rival.unseen.behind_m, rival.unseen.ahead_m);
  main_ = std::move(next);
  for (auto& other : rivals_) other.forget_excess();
}

void Hypotheses::apply_fix(const FixInput& fix, const Event& event) {
  predict_to(fix.stamp_ns);
  Estimator before = main_;
  const Excess most = most_excess();
  main_.contradicted_by(std::max(most.behind_m, most.ahead_m));
  main_.apply(event);
  main_.contradicted_by(0);
  std::vector<Doubter> doubters_before = doubters_;
  for (auto& doubter : doubters_) {
    if (!doubter.leaves_out(fix)) doubter.estimator.apply(event);
  }
  for (auto& rival : rivals_) {
    if (rival.estimator) rival.estimator->apply(event);
  }
  if (main_.fix_refused() || main_.fix_used()) fix_fitted_ = main_.fix_used() && !main_.fix_corrected();
  if (main_.fix_refused()) {
    if (adopt_by_fix(fix, before, doubters_before) || !adopt_doubter(fix, std::move(doubters_before))) return;
  } else if (main_.fix_used()) {
    auto without = without_two(fix, doubters_before);
    without.push_back(without_one(fix, std::move(before), most));
    if (std::ranges::none_of(doubters_, [&](const Doubter& doubter) { return doubter.leaves_out(fix); })) {
      settle_doubters(fix, doubters_before);
      if (!fix.new_path) std::ranges::move(without, std::back_inserter(doubters_));
    }
  } else {
    return;
  }
  confirm_rivals();
}

// The fix contradicts an earlier one and agrees with what is known without that one. Without that one less is known, so
// the fix may agree by chance: the interval holds what is known without either, too. One that more landmarks have
// outvoted comes back when as many speak for it.
bool Hypotheses::adopt_doubter(const FixInput& fix, std::vector<Doubter> before) {
  const auto fits = std::find_if(doubters_.rbegin(), doubters_.rend(), std::mem_fn(&Doubter::fits));
  if (fits == doubters_.rend()) return false;
  if (fits->against > kFixesOfAClaim) {
    for (auto& doubter : doubters_) doubter.against -= doubter.fits() ? 1 : 0;
    return false;
  }
  auto& without_it = before[static_cast<size_t>(doubters_.rend() - fits) - 1];
  Doubter without_both{std::move(without_it.estimator), fix.landmark, fix.kind == FixKind::curvature};
  std::swap(main_, fits->estimator);
  doubters_ = {Doubter{std::move(fits->estimator)}, std::move(without_both)};
  return true;
}

Hypotheses::Doubter Hypotheses::without_one(const FixInput& fix, Estimator before, const Excess& most) const {
  Doubter doubter{std::move(before), fix.landmark, fix.kind == FixKind::curvature};
  const Interval slip = doubter.estimator.widened({});
  doubter.excused_m = std::max({most.behind_m, most.ahead_m, -slip.behind_m, slip.ahead_m});
  doubter.confirmed_by = doubter.estimator.landmarks_agreed();
  doubter.against = main_.fix_corrected() ? kFixesOfAClaim : 1;
  return doubter;
}

std::vector<Hypotheses::Doubter> Hypotheses::without_two(const FixInput& fix,
                                                         const std::vector<Doubter>& before) const {
  std::vector<Doubter> without;
  if (!told_by_others(fix)) return without;
  for (size_t i = 0; i < before.size(); ++i) {
    const auto& now = doubters_[i];
    if (now.of_shape || now.of_two || !now.fits()) continue;
    auto both = before[i];
    both.landmark = fix.landmark;
    both.of_two = true;
    both.agreed = 0;
    both.against = kFixesOfAClaim;
    without.push_back(std::move(both));
  }
  return without;
}

void Hypotheses::settle_doubters(const FixInput& fix, const std::vector<Doubter>& before) {
  std::vector<Doubter> open;
  for (size_t i = 0; i < doubters_.size(); ++i) {
    if (!fix.new_path && !settle(doubters_[i], before[i].estimator, fix)) open.push_back(std::move(doubters_[i]));
  }
  doubters_ = std::move(open);
}

// What the main one alone fits is confirmed, what both fit may be so by chance once, not twice. But where the doubter's
// odometers cannot be so far off, and no single one of them either, landmarks may be wrong alike: it does without them
// until they are too many for that, or GNSS speaks against it.
bool Hypotheses::settle(Doubter& doubter, const Estimator& before, const FixInput& fix) const {
  const bool contradicted = doubter.estimator.fix_refused() || doubter.estimator.fix_corrected();
  const bool of_shape = fix.kind == FixKind::curvature;
  if (doubter.of_shape) return of_shape || contradicted;
  if (of_shape && !contradicted) return false;
  const bool enough = contradicted || ++doubter.agreed >= kFixesToSettle;
  const double sigmas = doubter.estimator.fix_sigmas_off(doubter.excused_m);
  if (sigmas < kUnlikelySigmas) return enough;
  const bool gnss_denies = before.watch(Source::gnss).isolated && !main_.watch(Source::gnss).isolated;
  doubter.estimator = before;
  doubter.against += of_shape ? 0 : 1;
  const bool outvoted = landmark_evidence(doubter.against) >= evidence_to_settle(sigmas, doubter.confirmed_by);
  return enough && (gnss_denies || outvoted);
}

void Hypotheses::confirm_rivals() {
  for (auto& rival : rivals_) {
    rival.forget_excess();
    // Confirmed is the main one: a rival that is elsewhere was wrong.
    if (rival.estimator && rival.estimator->fix_refused()) rival.estimator = main_;
  }
  ask_rivals();
}

// The main one refuses the fix, but without one certain sensor it fits: that sensor is wrong, or the fix is; until the
// next one the interval holds both.
bool Hypotheses::adopt_by_fix(const FixInput& fix, const Estimator& before, const std::vector<Doubter>& doubters) {
  Rival* only = nullptr;
  for (auto& rival : rivals_) {
    if (!rival.asked || !rival.estimator->fix_used()) continue;
    if (only != nullptr) return false;
    only = &rival;
  }
  const bool two_odometers = main_.watch(Source::camera).seen_ns != 0 && main_.watch(Source::wheel).seen_ns != 0;
  if (only == nullptr || !two_odometers) return false;
  adopt(*only);
  // The fixes that were not sure are no surer now.
  doubters_ = doubters;
  doubters_.push_back({before, fix.landmark, fix.kind == FixKind::curvature});
  ask_rivals();
  return true;
}

void Hypotheses::predict_to(int64_t stamp_ns) {
  main_.predict_to(stamp_ns);
  for (auto& doubter : doubters_) doubter.estimator.predict_to(stamp_ns);
  for (auto& rival : rivals_) {
    if (rival.asked) rival.estimator->predict_to(stamp_ns);
  }
}

void Hypotheses::rebase_clock(int64_t stamp_ns) {
  main_.rebase_clock(stamp_ns);
  for (auto& doubter : doubters_) doubter.estimator.rebase_clock(stamp_ns);
  for (auto& rival : rivals_) {
    if (rival.estimator) rival.estimator->rebase_clock(stamp_ns);
    rival.asked_ns = std::min(rival.asked_ns, stamp_ns);
    rival.strayed_ns = std::min(rival.strayed_ns, stamp_ns);
    rival.proven_since_ns = 0;
  }
}

void Hypotheses::follow_on(const std::shared_ptr<const track::Path>& path,
                           const std::shared_ptr<const track::Path>& longer) {
  main_.follow_on(path, longer);
  for (auto& doubter : doubters_) doubter.estimator.follow_on(path, longer);
  for (auto& rival : rivals_) {
    if (rival.estimator) rival.estimator->follow_on(path, longer);
  }
}

uint32_t Hypotheses::slipping() const {
  uint32_t bits = main_.watch(Source::wheel).isolated ? 1U : 0U;
  for (size_t i = 0; i < rivals_.size(); ++i) {
    const auto& estimator = rivals_[i].estimator;
    if (estimator && estimator->watch(Source::wheel).isolated) bits |= 2U << i;
  }
  return bits;
}

void Hypotheses::block_wheel(const WheelBlock& block, uint32_t slipping) {
  if ((slipping & 1U) != 0) {
    main_.block_wheel(block);
    for (auto& doubter : doubters_) doubter.estimator.block_wheel(block);
  }
  for (size_t i = 0; i < rivals_.size(); ++i) {
    auto& estimator = rivals_[i].estimator;
    if (estimator && (slipping & (2U << i)) != 0) estimator->block_wheel(block);
  }
}

void Hypotheses::begin_rival(Source source) {
  for (auto& rival : rivals_) {
    if (rival.without == source && !rival.estimator) rival.estimator = main_;
  }
}

void Hypotheses::ask_rivals() {
  for (auto& rival : rivals_) ask(rival);
}

void Hypotheses::ask(Rival& rival) {
  const int64_t now_ns = main_.filter().stamp_ns();
  const bool can_say = rival.estimator && main_.watch(rival.without).used_ns != 0 && rival.estimator->knows_motion() &&
                       rival.estimator->is_consistent();
  if (!can_say) {
    rival.asked = false;
    if (!rival.estimator) return;
    const bool consistent = rival.estimator->is_consistent();
    // What the main one has not used yet the rival does not lack: it is not away.
    if (main_.watch(rival.without).used_ns == 0 && rival.estimator->knows_motion()) rival.asked_ns = now_ns;
    if (consistent && core::seconds(now_ns - rival.asked_ns) < kSameSpeedsS) stray(rival, now_ns);
    rival.contradicted = rival.contradicted || !consistent;
    return;
  }
  auto& other = *rival.estimator;
  if (!rival.asked && core::seconds(now_ns - rival.asked_ns) > kRivalGoneS) {
    // It was away: it begins again where the main one is, and what it had said before stays.
    lose_sight(rival, now_ns);
    // A train without camera may have nothing but the rival's wheel.
    if (rival.contradicted && (main_.knows_motion() || main_.watch(Source::camera).seen_ns != 0)) {
      other = main_;
    } else {
      other.place_like(main_);
    }
    rival.carried = rival.excess;
  }
  rival.contradicted = false;
  rival.asked = true;
  rival.asked_ns = now_ns;
  other.predict_to(now_ns);
  const Interval mine = main_.interval();
  Interval its = other.interval();
  double apart_m = other.centre_m() - main_.centre_m();
  if (rival.without == Source::gnss && main_.gnss_proven()) {
    apart_m = std::clamp(apart_m, -parameters_->gnss_bound_m, parameters_->gnss_bound_m);
    its.behind_m = std::max(its.behind_m, mine.behind_m - parameters_->gnss_bound_m);
    its.ahead_m = std::min(its.ahead_m, mine.ahead_m + parameters_->gnss_bound_m);
  }
  // Since it came back both have gone on from one place: how far they come apart since adds to what it had said before.
  rival.excess.behind_m = std::max(rival.carried.behind_m + std::max(0.0, -apart_m), mine.behind_m - its.behind_m);
  rival.excess.ahead_m = std::max(rival.carried.ahead_m + std::max(0.0, apart_m), its.ahead_m - mine.ahead_m);
  rival.faster_mps = other.filter().speed_mps() - main_.filter().speed_mps();
  rival.strayed_ns = now_ns;
}

// It takes over a place that the main one has counted by the very sensor that this rival doubts: should that prove
// wrong, the train is where the rival's own reckoning allows.
void Hypotheses::lose_sight(Rival& rival, int64_t now_ns) const {
  Estimator own = *rival.estimator;
  own.predict_to(now_ns);
  const Interval mine = main_.widened(main_.interval());
  const Interval its = own.interval();
  rival.unseen.behind_m = std::max(rival.unseen.behind_m, mine.behind_m - its.behind_m);
  rival.unseen.ahead_m = std::max(rival.unseen.ahead_m, its.ahead_m - mine.ahead_m);
}

// Nothing tells any more how far they come apart: for a while as fast as they did last.
void Hypotheses::stray(Rival& rival, int64_t now_ns) {
  const double apart_m = rival.faster_mps * core::seconds(now_ns - std::exchange(rival.strayed_ns, now_ns));
  rival.excess.behind_m += std::max(0.0, -apart_m);
  rival.excess.ahead_m += std::max(0.0, apart_m);
}

Hypotheses::Excess Hypotheses::most_excess() const {
  Excess most;
  for (const auto& rival : rivals_) {
    most.behind_m = std::max(most.behind_m, rival.excess.behind_m);
    most.ahead_m = std::max(most.ahead_m, rival.excess.ahead_m);
  }
  return most;
}

Interval Hypotheses::promised(const Interval& main) const {
  const Excess most = most_excess();
  return {main.behind_m - most.behind_m, main.ahead_m + most.ahead_m};
}

Promise Hypotheses::promise() const {
  Estimator main = main_;
  main.predict_to(stamp_ns());
  Promise all{main.widened(promised(main.interval())), main.since_reference_m()};
  for (const auto& doubter : doubters_) {
    Estimator other = doubter.estimator;
    other.predict_to(stamp_ns());
    all.hold({other.widened(other.interval()), other.since_reference_m()});
  }
  return all;
}

TrainEstimate Hypotheses::estimate(const Promise& promise) const {
  Estimator main = main_;
  main.predict_to(stamp_ns());
  return main.estimate(promise.interval, promise.since_sure_m);
}

OdometerScales Hypotheses::scales() const {
  OdometerScales all = main_.filter().scales();
  for (const auto& doubter : doubters_) {
    const auto other = doubter.estimator.filter().scales();
    all.camera_sigma = std::max(all.camera_sigma, std::hypot(other.camera - all.camera, other.camera_sigma));
    all.wheel_sigma = std::max(all.wheel_sigma, std::hypot(other.wheel - all.wheel, other.wheel_sigma));
  }
  return all;
}

}  // namespace railfix::fusion
