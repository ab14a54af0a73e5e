#include "fusion/hypotheses.hpp"

#include <algorithm>
#include <cmath>
#include <functional>
#include <iterator>
#include <utility>

#include "fusion/jump_evidence.hpp"

namespace railfix::fusion {
namespace {

constexpr int kFixesToSettle = 2;
constexpr int kFixesOfAClaim = 2;  // move the train against the filter
constexpr double kSureFix = 0.99;

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
  interval.rear_m = std::min(interval.rear_m, other.interval.rear_m);
  interval.front_m = std::max(interval.front_m, other.interval.front_m);
  since_sure_m = std::max(since_sure_m, other.since_sure_m);
}

Hypotheses::Hypotheses(const FusionParameters* parameters, const OdometerScales& scales,
                       std::shared_ptr<const track::Path> path, int64_t stamp_ns)
    : parameters_(parameters),
      main_(parameters, scales, std::move(path), stamp_ns),
      rivals_{Rival{.without = Source::camera}, Rival{.without = Source::wheel}, Rival{.without = Source::imu},
              Rival{.without = Source::gnss}} {}

void Hypotheses::apply(const Event& event) {
  fix_fitted_.reset();
  const auto* fix = std::get_if<FixInput>(&event);
  if (fix != nullptr && fix->kind != FixKind::track) {
    apply_fix(event);
  } else {
    apply_to_all(event);
  }
  if (const auto against = main_.place().wrong_place().proven()) give_place_up(*against);
}

void Hypotheses::apply_to_all(const Event& event) {
  const Source source = source_of(event);
  begin_rival(source);
  main_.apply(event);
  for (auto& doubter : doubters_) doubter.estimator.apply(event);
  for (auto& rival : rivals_) {
    if (rival.estimator && rival.without != source) rival.estimator->apply(event);
  }
  if (source == Source::camera || source == Source::wheel || (source == Source::imu && main_.sensors().in_the_dark())) {
    exclude_faulty();
    ask_rivals();
  }
}

void Hypotheses::give_place_up(Against because) {
  doubters_.clear();
  residuals_ = {};
  main_.give_place_up(because);
  for (auto& rival : rivals_) {
    if (rival.estimator) rival.estimator->give_place_up(because);
  }
}

void Hypotheses::apply_fix(const Event& event) {
  const auto& fix = std::get<FixInput>(event);
  predict_to(fix.stamp_ns);
  Estimator before = main_;
  const Sides most = most_excess();
  main_.apply(event, {.excess_m = std::max(most.behind_m, most.ahead_m)});
  const bool judged = main_.fix().used() || main_.fix().refused();
  if (judged && fix.kind == FixKind::landmark && !main_.fix().again)
    residuals_.add(fix.landmark, main_.fix().offer.residual, main_.fix().sigmas_off(), before.since_fix_m());
  std::vector<Doubter> doubters_before = doubters_;
  for (auto& doubter : doubters_) {
    if (!doubter.leaves_out(fix)) doubter.estimator.apply(event);
  }
  for (auto& rival : rivals_) {
    if (rival.estimator) rival.estimator->apply(event, {.unwidened = true});
  }
  if (judged) fix_fitted_ = main_.fix().used() && !main_.fix().corrected();
  if (main_.fix().refused()) {
    if (adopt_by_fix(fix, before, doubters_before) || !adopt_doubter(fix, std::move(doubters_before))) return;
  } else if (main_.fix().used()) {
    auto without = without_two(fix, doubters_before);
    without.push_back(without_one(fix, std::move(before), most));
    const auto leaves_out = [&](const Doubter& doubter) { return doubter.leaves_out(fix); };
    if (!main_.fix().again && std::ranges::none_of(doubters_, leaves_out)) {
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

Hypotheses::Doubter Hypotheses::without_one(const FixInput& fix, Estimator before, const Sides& most) const {
  Doubter doubter{.estimator = std::move(before), .landmark = fix.landmark, .of_shape = fix.kind == FixKind::curvature};
  const Interval slip = doubter.estimator.widened({});
  doubter.excused_m = std::max({most.behind_m, most.ahead_m, -slip.rear_m, slip.front_m});
  doubter.surprising = doubter.of_shape && main_.fix().unexpected();
  doubter.confirmed_by = doubter.estimator.place().told().landmarks_agreed();
  // A false fix beside a sensor that is wrong settles nothing of what the rivals held.
  if (doubter.estimator.sensors().dispute(kMotionSources)) doubter.estimator.doubt_place(most);
  doubter.against = main_.fix().corrected() ? kFixesOfAClaim : 1;
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
  const bool contradicted = doubter.estimator.fix().refused() || doubter.estimator.fix().corrected();
  const bool of_shape = fix.kind == FixKind::curvature;
  if (doubter.of_shape) return of_shape || contradicted;
  if (of_shape && !contradicted) return false;
  const bool enough = contradicted || (++doubter.agreed >= kFixesToSettle && !differs_in_scale(doubter));
  if (doubter.estimator.fix().sigmas_off() < kUnlikelySigmas) return enough;
  const double sigmas = doubter.estimator.fix().sigmas_off(doubter.excused_m);
  const bool gnss_denies = before.watch(Source::gnss).isolated && !main_.watch(Source::gnss).isolated;
  doubter.estimator = before;
  doubter.against += of_shape ? 0 : 1;
  const double needed = sigmas < kUnlikelySigmas ? kExcusedEvidence : evidence_to_settle(sigmas, doubter.confirmed_by);
  const bool outvoted = landmark_evidence(doubter.against) >= needed;
  return enough && (gnss_denies || outvoted);
}

// Where both are is the same now. But a false fix may have taught the main one a scale, with which it will be elsewhere
// again before its interval has grown as far.
bool Hypotheses::differs_in_scale(const Doubter& doubter) const {
  const auto& mine = main_.filter();
  const double apart = std::abs(doubter.estimator.filter().scale(mine.unit()) - mine.scale(mine.unit()));
  return apart > parameters_->interval_drift + parameters_->interval_factor * mine.scale_sigma(mine.unit());
}

// The main one refuses the fix, but without one certain sensor it fits: that sensor is wrong, or the fix is; until the
// next one the interval holds both.
bool Hypotheses::adopt_by_fix(const FixInput& fix, const Estimator& before, const std::vector<Doubter>& doubters) {
  Rival* only = nullptr;
  for (auto& rival : rivals_) {
    if (!rival.asked || !rival.estimator->fix().used()) continue;
    if (only != nullptr) return false;
    only = &rival;
  }
  const bool two_odometers = main_.watch(Source::camera).seen_ns != 0 && main_.watch(Source::wheel).seen_ns != 0;
  if (only == nullptr || !two_odometers) return false;
  adopt(*only, without_faulty(*only));
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
    rival.excess_ns = std::min(rival.excess_ns, stamp_ns);
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

Promise Hypotheses::promise() const {
  Estimator main = main_;
  main.predict_to(stamp_ns());
  const Interval mine = main.interval();
  Promise all{main.widened(promised(mine)), main.since_reference_m()};
  for (const auto& doubter : doubters_) {
    Estimator other = doubter.estimator;
    other.predict_to(stamp_ns());
    all.hold({other.widened(other.interval()), other.since_reference_m()});
  }
  const double doubt_m =
      parameters_->interval_factor * residuals_.scatter_m() + residuals_.error_per_m() * main.since_fix_m();
  const Interval doubted = main.widened({mine.rear_m - doubt_m, mine.front_m + doubt_m});
  all.hold({doubted, all.since_sure_m});
  return all;
}

TrainEstimate Hypotheses::estimate(const Promise& promise) const {
  Estimator main = main_;
  main.predict_to(stamp_ns());
  auto estimate = main.estimate(promise.interval, promise.since_sure_m);
  if (residuals_.scatter_m() > 0) estimate.degrade("landmarks err by more than they say");
  return estimate;
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
