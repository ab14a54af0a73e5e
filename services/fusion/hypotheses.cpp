#include "fusion/hypotheses.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "core/time.hpp"

namespace railfix::fusion {
namespace {

constexpr double kSureProbability = 0.999;  // from here on a fix needs no second one
constexpr double kVoteS = 1.0;              // the others must agree for so long before one source is left out
constexpr double kSeparateSigmas = 3.0;
constexpr double kRivalGoneS = 1.0;

Source source_of(const Event& event) {
  if (std::holds_alternative<ImuInput>(event)) return Source::imu;
  if (std::holds_alternative<WheelInput>(event)) return Source::wheel;
  if (std::holds_alternative<GnssInput>(event)) return Source::gnss;
  if (std::holds_alternative<FixInput>(event)) return Source::landmark;
  return Source::camera;
}

}  // namespace

Hypotheses::Hypotheses(const FusionParameters* parameters, std::shared_ptr<const track::Path> path, int64_t stamp_ns)
    : parameters_(parameters),
      main_(parameters, std::move(path), stamp_ns),
      rivals_{Rival{Source::camera, {}, {}, {}}, Rival{Source::wheel, {}, {}, {}}, Rival{Source::imu, {}, {}, {}},
              Rival{Source::gnss, {}, {}, {}}} {}

void Hypotheses::apply(const Event& event) {
  if (const auto* fix = std::get_if<FixInput>(&event)) {
    apply_fix(*fix, event);
    return;
  }
  const Source source = source_of(event);
  begin_rival(source);
  main_.apply(event);
  if (without_last_fix_) without_last_fix_->apply(event);
  for (auto& rival : rivals_) {
    if (rival.estimator && rival.without != source) rival.estimator->apply(event);
  }
  if (source == Source::camera || source == Source::wheel) {
    ask_rivals();
    vote();
  }
}

void Hypotheses::apply_fix(const FixInput& fix, const Event& event) {
  predict_to(fix.stamp_ns);
  Estimator before = main_;
  main_.apply(event);
  for (auto& rival : rivals_) {
    if (rival.estimator) rival.estimator->apply(event);
  }
  if (!main_.fix_used()) {
    if (main_.fix_refused()) fix_refused(event, std::move(before));
    return;
  }
  without_last_fix_.reset();
  if (!fix.new_path && fix.probability < kSureProbability) without_last_fix_ = std::move(before);
  held_ = {};
  for (auto& rival : rivals_) rival.excess = rival.carried = {};
  ask_rivals();
}

// Either a source has led the main estimator astray and the one without it knows better, or the last fix was false.
void Hypotheses::fix_refused(const Event& event, Estimator&& before) {
  if (const Rival* rival = rival_for(before)) {
    take(*rival);
    without_last_fix_ = std::move(before);
    return;
  }
  if (!without_last_fix_) return;
  Estimator other = *without_last_fix_;
  other.apply(event);
  if (other.fix_used()) main_ = std::move(other);
}

const Hypotheses::Rival* Hypotheses::rival_for(const Estimator& before) const {
  for (const auto& rival : rivals_) {
    if (!rival.asked || main_.is_banned(rival.without)) continue;
    const auto& other = *rival.estimator;
    if (!other.fix_used()) continue;
    const double apart_m = std::abs(other.centre_m() - before.centre_m());
    if (apart_m > kSeparateSigmas * std::hypot(before.sigma_m(), other.sigma_m())) return &rival;
  }
  return nullptr;
}

void Hypotheses::predict_to(int64_t stamp_ns) {
  main_.predict_to(stamp_ns);
  if (without_last_fix_) without_last_fix_->predict_to(stamp_ns);
  for (auto& rival : rivals_) {
    if (rival.asked) rival.estimator->predict_to(stamp_ns);
  }
}

void Hypotheses::rebase_clock(int64_t stamp_ns) {
  main_.rebase_clock(stamp_ns);
  if (without_last_fix_) without_last_fix_->rebase_clock(stamp_ns);
  for (auto& rival : rivals_) {
    if (rival.estimator) rival.estimator->rebase_clock(stamp_ns);
    rival.asked_ns = std::min(rival.asked_ns, stamp_ns);
  }
  suspect_.reset();
}

uint32_t Hypotheses::slipping() const {
  uint32_t bits = main_.watch(Source::wheel).isolated ? 1U : 0U;
  for (size_t i = 0; i < rivals_.size(); ++i) {
    const auto& estimator = rivals_[i].estimator;
    if (estimator && estimator->watch(Source::wheel).isolated) bits |= 2U << i;
  }
  return bits;
}

void Hypotheses::block_wheel_until(int64_t stamp_ns, uint32_t slipping) {
  if ((slipping & 1U) != 0) {
    main_.block_wheel_until(stamp_ns);
    if (without_last_fix_) without_last_fix_->block_wheel_until(stamp_ns);
  }
  for (size_t i = 0; i < rivals_.size(); ++i) {
    auto& estimator = rivals_[i].estimator;
    if (estimator && (slipping & (2U << i)) != 0) estimator->block_wheel_until(stamp_ns);
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
    return;
  }
  auto& other = *rival.estimator;
  if (!rival.asked && core::seconds(now_ns - rival.asked_ns) > kRivalGoneS) {
    // It was away: it begins again where the main one is, and what it had said before stays.
    other.place_like(main_);
    rival.carried = rival.excess;
  }
  rival.asked = true;
  rival.asked_ns = now_ns;
  other.predict_to(now_ns);
  const Interval mine = main_.interval();
  Interval its = other.interval();
  if (rival.without == Source::gnss && main_.gnss_proven()) {
    its.behind_m = std::max(its.behind_m, mine.behind_m - parameters_->gnss_bound_m);
    its.ahead_m = std::min(its.ahead_m, mine.ahead_m + parameters_->gnss_bound_m);
  }
  rival.excess.behind_m = std::max(rival.carried.behind_m, mine.behind_m - its.behind_m);
  rival.excess.ahead_m = std::max(rival.carried.ahead_m, its.ahead_m - mine.ahead_m);
}

// When the main estimator contradicts itself and only one source, left out, makes two others agree, that one is wrong.
void Hypotheses::vote() {
  std::optional<Source> suspect;
  if (!main_.is_consistent()) {
    int explanations = 0;
    for (const auto& rival : rivals_) {
      if (!rival.asked || rival.without == Source::gnss || rival.estimator->motion_sensors() < 2) continue;
      ++explanations;
      suspect = rival.without;
    }
    if (explanations != 1 || main_.watch(*suspect).isolated) suspect.reset();
  }
  const int64_t now_ns = main_.filter().stamp_ns();
  if (suspect != suspect_) suspect_since_ns_ = now_ns;
  suspect_ = suspect;
  if (!suspect || core::seconds(now_ns - suspect_since_ns_) < kVoteS) return;
  for (const auto& rival : rivals_) {
    if (rival.without == *suspect) take(rival);
  }
  suspect_.reset();
}

// The interval goes on to hold what it held.
void Hypotheses::take(const Rival& rival) {
  const Interval before = promised(main_.interval());
  const auto watch = main_.watch(rival.without);
  main_ = *rival.estimator;
  main_.ban(rival.without, watch);
  const Interval after = main_.interval();
  held_.behind_m = std::max(0.0, after.behind_m - before.behind_m);
  held_.ahead_m = std::max(0.0, before.ahead_m - after.ahead_m);
  for (auto& each : rivals_) each.excess = each.carried = {};
  ask_rivals();
}

Interval Hypotheses::promised(const Interval& main) const {
  Excess most = held_;
  for (const auto& rival : rivals_) {
    most.behind_m = std::max(most.behind_m, rival.excess.behind_m);
    most.ahead_m = std::max(most.ahead_m, rival.excess.ahead_m);
  }
  return {main.behind_m - most.behind_m, main.ahead_m + most.ahead_m};
}

TrainEstimate Hypotheses::estimate() const {
  Estimator main = main_;
  main.predict_to(stamp_ns());
  Interval all = promised(main.interval());
  double since_sure_m = main.since_reference_m();
  if (without_last_fix_) {
    Estimator other = *without_last_fix_;
    other.predict_to(stamp_ns());
    const Interval its = other.interval();
    all.behind_m = std::min(all.behind_m, its.behind_m);
    all.ahead_m = std::max(all.ahead_m, its.ahead_m);
    since_sure_m = other.since_reference_m();
  }
  return main.estimate(all, since_sure_m);
}

}  // namespace railfix::fusion
