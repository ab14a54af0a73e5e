#include "tpr_publisher/train_integrity.hpp"

#include <algorithm>
#include <cmath>

#include "core/time.hpp"

namespace railfix::tpr_publisher {

namespace {

constexpr int64_t kHistoryNs = 10 * core::kNsPerSecond;
constexpr uint32_t kLongestM = 32767;  // L_TRAININT

}  // namespace

void TrainIntegrity::follow(const Place& place) {
  places_.push_back(place);
  while (place.stamp_ns - places_.front().stamp_ns > kHistoryNs) places_.pop_front();
  then_.moved_m += place.moved_m;
  if (!std::isfinite(then_.moved_m)) forget_rear();
  settle();
}

void TrainIntegrity::lose_way() {
  places_.clear();
  forget_rear();
}

void TrainIntegrity::forget_rear() {
  forgotten_ = forgotten_ || rear_m_;
  rear_m_.reset();
}

void TrainIntegrity::hear(uint32_t q_integrity, int64_t integrity_ns, double train_length_m) {
  if (!is_confirmed(q_integrity)) {
    heard_ = {q_integrity, integrity_ns};
    next_.reset();
    rear_m_.reset();
    settled_ = true;
    return;
  }
  const bool other_length = train_length_m != train_length_m_;
  if (other_length && integrity_ns == confirmed_ns_) used_up_ns_ = integrity_ns;
  confirmed_ns_ = integrity_ns;
  if (is_confirmed(heard_.q_integrity) && !other_length) {
    if (integrity_ns == heard_.integrity_ns) {
      heard_.q_integrity = q_integrity;
      return;
    }
    if (!settled_) {
      next_ = {q_integrity, integrity_ns};
      return;
    }
  }
  if (settled_) before_ = heard_;
  heard_ = {q_integrity, integrity_ns};
  next_.reset();
  train_length_m_ = train_length_m;
  if (other_length) rear_m_.reset();
  forgotten_ = false;
  settled_ = false;
  settle();
}

void TrainIntegrity::use_up_until(int64_t stamp_ns) {
  if (next_ && next_->integrity_ns <= stamp_ns) {
    heard_ = *next_;
    next_.reset();
  }
  if (is_confirmed(heard_.q_integrity) && heard_.integrity_ns <= stamp_ns) {
    before_ = {};
    used_up_ns_ = heard_.integrity_ns;
  } else if (!settled_ && before_.integrity_ns <= stamp_ns) {
    use_up();
  }
}

void TrainIntegrity::settle() {
  while (!settled_ && !places_.empty() && places_.back().stamp_ns >= heard_.integrity_ns) {
    place_rear();
    settled_ = true;
    if (!next_) return;
    before_ = heard_;
    heard_ = *next_;
    next_.reset();
    settled_ = false;
  }
}

void TrainIntegrity::place_rear() {
  rear_m_.reset();
  // The last place before is taken: farther behind when the train runs forward, which is the safe side.
  const auto after = std::upper_bound(places_.begin(), places_.end(), heard_.integrity_ns,
                                      [](int64_t stamp_ns, const Place& place) { return stamp_ns < place.stamp_ns; });
  if (after == places_.begin() || !(train_length_m_ > 0)) return;
  then_ = *std::prev(after);
  then_.moved_m = 0;
  for (auto place = after; place != places_.end(); ++place) then_.moved_m += place->moved_m;
  if (then_.known && std::isfinite(then_.moved_m)) rear_m_ = then_.distance_m - then_.over_m - train_length_m_;
}

TrainIntegrity::Said TrainIntegrity::said(double distance_m, double reported_ahead_m) const {
  if (!is_confirmed(q_integrity())) return {q_integrity(), std::nullopt};
  if (!rear_m_ || integrity_ns() == used_up_ns_) return {};
  const double moved_m = std::max(0.0, then_.moved_m);
  const double length_m = std::ceil(std::max(distance_m, then_.distance_m) - *rear_m_ + reported_ahead_m + moved_m);
  if (!(length_m <= kLongestM)) return {};
  // A train shorter than the step of D_LRBG may lie in front of the front end that was reported.
  return {q_integrity(), static_cast<uint32_t>(std::max(length_m, 0.0))};
}

}  // namespace railfix::tpr_publisher
