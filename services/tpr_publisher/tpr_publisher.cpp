#include "tpr_publisher/tpr_publisher.hpp"

#include <cmath>
#include <cstdio>

#include "core/time.hpp"

namespace railfix::tpr_publisher {

namespace {

constexpr int64_t kOldestNs = core::kNsPerSecond;

/// Empty when the position is young enough.
std::string age_refusal(int64_t stamp_ns, int64_t now_ns) {
  const int64_t age_ns = now_ns - stamp_ns;
  if (age_ns < kOldestNs && age_ns > -kOldestNs) return "";
  char text[160];
  if (age_ns > 0) {
    std::snprintf(text, sizeof text, "Position report not sent: the last train_state is %.1f s old, the limit is 1 s.",
                  core::seconds(age_ns));
  } else {
    std::snprintf(
        text, sizeof text,
        "Position report not sent: the last train_state lies %.1f s in the future; synchronise the hosts' clocks.",
        -core::seconds(age_ns));
  }
  return text;
}

}  // namespace

TprPublisher::TprPublisher(std::shared_ptr<const track::Map> map, const Settings& settings)
    : settings_(settings), trigger_(settings.parameters, settings.train_length_m) {
  if (map) tracker_.emplace(std::move(map), settings.search_behind_m);
  const auto trial = make_report({}, std::nullopt, Motion::unknown, settings.report, 0);
  core::value_or_throw(etcs::encode(trial, settings.report.baseline));
}

void TprPublisher::follow(const TrainPosition& position) {
  position_ = position;
  if (!position.standstill && position.speed_mps != 0)
    motion_ = position.speed_mps > 0 ? Motion::forward : Motion::backward;
  if (!tracker_) return;
  if (position.place_known()) {
    tracker_->update(position.foot);
  } else {
    tracker_->lose();
  }
  reference_ = tracker_->reference();
}

Moment TprPublisher::moment(int64_t now_ns) const {
  Moment moment;
  moment.now_ns = now_ns;
  moment.standstill = position_->standstill;
  moment.front_m = position_->distance_m + settings_.report.foot_to_front_m;
  moment.max_safe_front_m = position_->under_m >= 0 ? moment.front_m + position_->under_m : HUGE_VAL;
  moment.min_safe_front_m = position_->over_m >= 0 ? moment.front_m - position_->over_m : -HUGE_VAL;
  if (reference_) {
    moment.nid_lrbg = reference_->group->nid_lrbg();
    moment.beyond_lrbg_m = reference_->foot_m + settings_.report.foot_to_front_m;
  }
  return moment;
}

Outcome TprPublisher::update(const TrainPosition& position, int64_t now_ns) {
  if (!std::isfinite(position.speed_mps) || !std::isfinite(position.distance_m)) {
    return {std::nullopt, "Position report not sent: speed or distance of the train_state is not a number."};
  }
  follow(position);
  const auto now = moment(now_ns);
  const auto reason = trigger_.due(now);
  if (!reason) return {};
  if (auto refusal = age_refusal(position.stamp_ns, now_ns); !refusal.empty())
    return {std::nullopt, std::move(refusal)};
  Report report{
      position.stamp_ns, now_ns, *reason, make_report(position, reference_, motion_, settings_.report, now_ns), {}};
  auto message = etcs::encode(report.fields, settings_.report.baseline);
  if (!message.ok()) return {std::nullopt, "Position report not sent: " + message.error().message};
  report.message = std::move(message).value();
  trigger_.sent(now);
  return {std::move(report), ""};
}

Outcome TprPublisher::tick(int64_t now_ns) {
  if (!position_) return {std::nullopt, "Position report not sent: no train_state yet."};
  auto refusal = age_refusal(position_->stamp_ns, now_ns);
  if (refusal.empty() || !trigger_.due(moment(now_ns))) return {};
  return {std::nullopt, std::move(refusal)};
}

}  // namespace railfix::tpr_publisher
