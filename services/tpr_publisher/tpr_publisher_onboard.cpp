// What the on-board unit says: mode, level, cab, wanted reports and train integrity, each by itself.
#include <algorithm>
#include <cstdlib>
#include <utility>

#include "core/time.hpp"
#include "tpr_publisher/tpr_publisher.hpp"

namespace railfix::tpr_publisher {
namespace {

constexpr int64_t kOnboardSilentNs = 3 * core::kNsPerSecond;

}  // namespace

core::Status TprPublisher::set_onboard(const Onboard& onboard, int64_t now_ns) {
  auto taken = hear_mode_and_level(onboard);
  settings_.report.train_data = onboard.train_length_m > 0;
  length_said_ = length_said_ || settings_.report.train_data;
  if (length_said_) trigger_.set_train_length(onboard.train_length_m);
  hear_cab(onboard.active_cab);
  hear_wants(onboard);
  hear_integrity(onboard, now_ns);
  return taken;
}

core::Status TprPublisher::hear_mode_and_level(const Onboard& onboard) {
  core::Status taken;
  const auto take = [&](const ReportSettings& report) {
    const auto trial = etcs::encode(make_report({}, std::nullopt, Motion::unknown, report, 0), report.baseline);
    if (trial.ok()) {
      settings_.report = report;
    } else if (taken.ok()) {
      taken = trial.error();
    }
    return trial.ok();
  };
  auto& stands = settings_.report;
  auto report = stands;
  report.m_mode = onboard.m_mode;
  const bool other_mode = report.m_mode != stands.m_mode;
  if (take(report) && other_mode) ++mode_changes_;
  report = stands;
  report.m_level = onboard.m_level;
  report.nid_ntc = onboard.nid_ntc;
  // 4.0.0 has one level for both.
  if (report.baseline == etcs::Baseline::b4 && report.m_level == etcs::kLevel3) report.m_level = etcs::kLevel2;
  const bool other_ntc = report.m_level == etcs::kLevelNtc && report.nid_ntc != stands.nid_ntc;
  const bool other_level = report.m_level != stands.m_level || other_ntc;
  if (take(report) && other_level) ++level_changes_;
  return taken;
}

// Whoever counts lower than before has begun anew.
void TprPublisher::hear_wants(const Onboard& onboard) {
  const uint32_t before = onboard_ ? onboard_->reports_wanted : 0;
  if (onboard.reports_wanted == before || onboard.reports_wanted == 0) return;
  ++wants_;
  wanted_because_ = onboard.wanted_because;
}

// While the driver walks to the other end nobody says anything: then the front stays where it was.
void TprPublisher::hear_cab(ActiveCab cab) {
  if (cab == ActiveCab::not_said) return;
  const auto was = std::exchange(cab_, cab);
  if (cab == was) return;
  if (tracker_) {
    tracker_->turn_front(is_turned());
    reference_ = tracker_->reference();
  }
  if (was == ActiveCab::not_said && !is_turned()) return;  // as it was taken for
  integrity_.lose_way();
  const bool front_was_known = was != ActiveCab::not_said || ends_.to_front_m(was);
  if (front_was_known) {
    trigger_.turn();
  } else {  // what was asked for stands: a process that began anew hears which cab it is
    trigger_.lose_way();
  }
}

void TprPublisher::hear_integrity(const Onboard& onboard, int64_t now_ns) {
  const bool again = onboard_ && onboard.integrity_ns == onboard_->integrity_ns;
  onboard_ = onboard;
  onboard_->stamp_ns = std::min(onboard.stamp_ns, now_ns);
  // What has come was said before now: what is later is the other clock's error.
  onboard_ahead_ns_ = onboard.stamp_ns - onboard_->stamp_ns;
  if (!again) {
    complete_ns_ = std::min(onboard.integrity_ns, onboard.stamp_ns) - onboard_ahead_ns_;
    complete_ahead_ns_ = std::max(onboard.integrity_ns - now_ns, onboard_ahead_ns_);
  }
  if (is_confirmed(onboard.q_integrity)) {
    onboard_ahead_ns_ = std::max(onboard_ahead_ns_, complete_ahead_ns_);
    if (onboard_ahead_ns_ > kMostAheadNs) onboard_->q_integrity = etcs::kNoIntegrityInformation;
  }
  integrity_.hear(onboard_->q_integrity, complete_ns_, onboard.train_length_m);
}

// One that is ahead of its time is as little to be believed as one that says nothing.
bool TprPublisher::onboard_silent(int64_t now_ns) const {
  return onboard_ && std::abs(now_ns - onboard_->stamp_ns) > kOnboardSilentNs;
}

bool TprPublisher::onboard_overtaken(int64_t stamp_ns, int64_t now_ns) const {
  return onboard_ && stamp_ns < onboard_->stamp_ns && !onboard_silent(now_ns);
}

}  // namespace railfix::tpr_publisher
