#include "fusion/hypotheses.hpp"

#include <algorithm>
#include <utility>

namespace railfix::fusion {
namespace {

constexpr double kSureProbability = 0.999;  // from here on a fix needs no second one

}  // namespace

void Hypotheses::apply(const Event& event) {
  if (const auto* fix = std::get_if<FixInput>(&event)) {
    apply_fix(*fix, event);
    return;
  }
  main_.apply(event);
  if (without_last_fix_) without_last_fix_->apply(event);
}

void Hypotheses::apply_fix(const FixInput& fix, const Event& event) {
  predict_to(fix.stamp_ns);
  Estimator before = main_;
  main_.apply(event);
  if (main_.fix_used()) {
    without_last_fix_.reset();
    if (!fix.new_path && fix.probability < kSureProbability) without_last_fix_ = std::move(before);
    return;
  }
  if (!without_last_fix_ || !main_.fix_refused()) return;
  // The new fix contradicts the last one: if it agrees with what was known before, the last one was false.
  Estimator other = *without_last_fix_;
  other.apply(event);
  if (other.fix_used()) main_ = std::move(other);
}

void Hypotheses::predict_to(int64_t stamp_ns) {
  main_.predict_to(stamp_ns);
  if (without_last_fix_) without_last_fix_->predict_to(stamp_ns);
}

void Hypotheses::rebase_clock(int64_t stamp_ns) {
  main_.rebase_clock(stamp_ns);
  if (without_last_fix_) without_last_fix_->rebase_clock(stamp_ns);
}

void Hypotheses::block_wheel_until(int64_t stamp_ns) {
  main_.block_wheel_until(stamp_ns);
  if (without_last_fix_) without_last_fix_->block_wheel_until(stamp_ns);
}

TrainEstimate Hypotheses::estimate() const {
  Hypotheses now = *this;
  now.predict_to(stamp_ns());
  Interval both = now.main_.interval();
  double since_sure_m = now.main_.since_reference_m();
  if (now.without_last_fix_) {
    const Interval other = now.without_last_fix_->interval();
    both.behind_m = std::min(both.behind_m, other.behind_m);
    both.ahead_m = std::max(both.ahead_m, other.ahead_m);
    since_sure_m = now.without_last_fix_->since_reference_m();
  }
  return now.main_.estimate(both, since_sure_m);
}

}  // namespace railfix::fusion
