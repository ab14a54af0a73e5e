#include "tpr_publisher/report_trigger.hpp"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <limits>

#include "core/time.hpp"
#include "tpr_publisher/train_integrity.hpp"

namespace railfix::tpr_publisher {

namespace {

// Of a cycle of 0: more would keep the link to the ground from everything else.
constexpr int64_t kShortestCycleNs = core::kNsPerSecond;
constexpr double kShortestCycleM = 1.0;
constexpr int64_t kClockJitterNs = 100'000'000;  // no clock that was set back
constexpr double kMostCorrectedM = 200;  // a place; what is farther off is another passage of the group, round a loop

// A clock that was set back by an hour does not silence the train for an hour.
int64_t time_since(int64_t then_ns, int64_t now_ns) {
  const int64_t since_ns = now_ns - then_ns;
  return since_ns > -kClockJitterNs ? since_ns : std::numeric_limits<int64_t>::max();
}

}  // namespace

ReportTrigger::ReportTrigger(const etcs::ReportParameters& parameters, double train_length_m)
    : train_length_m_(train_length_m) {
  set_parameters(parameters);
}

void ReportTrigger::set_parameters(const etcs::ReportParameters& parameters, std::optional<uint32_t> origin,
                                   bool waited) {
  parameters_ = parameters;
  origin_ = origin;
  origin_m_.reset();
  waits_since_m_.reset();
  passed_before_ = !waited;
  locations_.clear();
  double at_m = 0;
  for (const auto& location : parameters.locations) {
    if (origin == etcs::kUnknownBaliseGroup) break;
    at_m += location.d_loc * etcs::scale_m(parameters.q_scale);
    locations_.push_back({at_m, location.q_lgtloc == 0, false});
  }
  location_passed_ = false;
  asked_ = parameters.m_loc == etcs::kReportNow;
}

void ReportTrigger::place_locations(const Moment& moment) {
  if (locations_.empty() || !moment.beyond_lrbg_m) return;
  if (!origin_) origin_ = moment.nid_lrbg;
  auto beyond_m = moment.beyond_origin_m;
  if (!beyond_m && *origin_ == moment.nid_lrbg) beyond_m = moment.beyond_lrbg_m;
  if (!beyond_m) return wait_for_origin(moment);
  waits_since_m_.reset();
  const double at_m = moment.front_m - *beyond_m;
  if (origin_m_ && std::abs(at_m - *origin_m_) > kMostCorrectedM) return;
  origin_m_ = at_m;  // anew: the place may have been corrected against the travelled distance
  origin_doubt_m_ = moment.origin_doubt_m;
  const bool is_ahead = *beyond_m < moment.foot_to_front_m;  // of the foot: it was read just now
  if (passed_before_ && !is_ahead) {
    for (auto& location : locations_) {
      const double reached_m = beyond_origin_m(moment, location.rear_end);
      location.passed = std::isfinite(reached_m) && reached_m >= location.at_m;
    }
  }
  passed_before_ = false;
}

void ReportTrigger::wait_for_origin(const Moment& moment) {
  if (origin_m_) return;
  passed_before_ = false;
  if (!waits_since_m_) waits_since_m_ = moment.front_m;
  const double most_m = kOriginWaitM + std::max(moment.foot_to_front_m, 0.0);
  if (std::abs(moment.front_m - *waits_since_m_) > most_m) locations_.clear();
}

bool ReportTrigger::rear_end_left_out() const {
  return !(train_length_m_ > 0) && std::any_of(locations_.begin(), locations_.end(), [](const Location& location) {
    return location.rear_end && !location.passed;
  });
}

void ReportTrigger::lose_way() {
  origin_m_.reset();
  waits_since_m_.reset();
  way_lost_ = true;
}

void ReportTrigger::turn() {
  lose_way();
  locations_.clear();
  reported_.reset();
  asked_ = group_passed_ = location_passed_ = false;
}

double ReportTrigger::beyond_origin_m(const Moment& moment, bool rear_end) const {
  if (!rear_end) return moment.max_safe_front_m + origin_doubt_m_ - *origin_m_;
  return train_length_m_ > 0 ? moment.min_safe_front_m - train_length_m_ - origin_doubt_m_ - *origin_m_ : -HUGE_VAL;
}

void ReportTrigger::note_events(const Moment& moment) {
  const bool taken_back = moment.taken_back != taken_back_;
  taken_back_ = moment.taken_back;
  if (taken_back) group_passed_ = false;  // correction() tells which one counts instead
  if (moment.nid_lrbg != etcs::kUnknownBaliseGroup && moment.nid_lrbg != last_group_) {
    last_group_ = moment.nid_lrbg;
    group_passed_ = !taken_back;
  }
  if (moment.passed_again > passed_again_) group_passed_ = true;
  passed_again_ = moment.passed_again;
  count_way(moment);
  for (auto& location : locations_) {
    if (!origin_m_ || location.passed || beyond_origin_m(moment, location.rear_end) < location.at_m) continue;
    location.passed = true;
    location_passed_ = true;
  }
}

int64_t ReportTrigger::since_report_ns(const Moment& moment) const {
  return time_since(reported_->now_ns, moment.now_ns);
}

// A place that trembles is no way.
void ReportTrigger::count_way(const Moment& moment) {
  const double further_m = std::abs(moment.front_m - way_to_m_);
  if (further_m < kShortestCycleM) return;
  way_m_ += further_m;
  way_to_m_ = moment.front_m;
}

bool ReportTrigger::cycle_distance_over(const Moment& moment) const {
  if (parameters_.d_cycloc == etcs::kNoCycleDistance) return false;
  const bool as_often_as_possible = parameters_.d_cycloc == 0;
  if (as_often_as_possible && since_report_ns(moment) < kShortestCycleNs) return false;
  const double period_m =
      as_often_as_possible ? kShortestCycleM : parameters_.d_cycloc * etcs::scale_m(parameters_.q_scale);
  return way_lost_ || way_m_ + std::abs(moment.front_m - way_to_m_) >= period_m;
}

bool ReportTrigger::cycle_time_over(const Moment& moment) const {
  if (parameters_.t_cycloc == etcs::kNoCycleTime) return false;
  return since_report_ns(moment) >= std::max(int64_t{parameters_.t_cycloc} * core::kNsPerSecond, kShortestCycleNs);
}

std::optional<Reason> ReportTrigger::onboard_reason(const Moment& moment) const {
  const auto& now = moment.onboard;
  const auto& then = reported_->onboard;
  if (moment.mode_changes != reported_->mode_changes) return Reason::mode;
  if (moment.level_changes != reported_->level_changes) return Reason::level;
  if (now.q_integrity == etcs::kIntegrityLost && then.q_integrity != etcs::kIntegrityLost)
    return Reason::integrity_lost;
  const bool confirmed = now.q_integrity != then.q_integrity || now.integrity_ns != then.integrity_ns;
  if (now.q_integrity == etcs::kConfirmedByDriver && confirmed) return Reason::integrity_confirmed;
  if (moment.wants != reported_->wants) return moment.wanted_because;
  return std::nullopt;
}

// Trackside must not go on with what has proved wrong until the cycle is over.
bool ReportTrigger::group_taken_back(const Moment& moment) const {
  if (reported_->nid_lrbg == etcs::kUnknownBaliseGroup || moment.taken_back == reported_->taken_back) return false;
  return reported_->nid_lrbg != moment.nid_lrbg || reported_->q_dirlrbg != moment.q_dirlrbg;
}

bool ReportTrigger::group_found_again(const Moment& moment) const {
  return reported_->nid_lrbg == etcs::kUnknownBaliseGroup && moment.nid_lrbg != etcs::kUnknownBaliseGroup &&
         since_report_ns(moment) >= kShortestCycleNs;
}

bool ReportTrigger::motion_turned(const Moment& moment) const {
  return moment.motion != Motion::unknown && moment.motion != reported_->motion;
}

// It must not fill the store.
bool ReportTrigger::comes_and_goes(const Moment& moment) const {
  return corrected_ns_ && time_since(*corrected_ns_, moment.now_ns) < kShortestCycleNs;
}

std::optional<Reason> ReportTrigger::correction(const Moment& moment) const {
  const bool known = moment.nid_lrbg != etcs::kUnknownBaliseGroup;
  if (!known && reported_->nid_lrbg != etcs::kUnknownBaliseGroup) return Reason::balise_group;
  if (group_found_again(moment)) return Reason::balise_group;
  if (comes_and_goes(moment)) return std::nullopt;
  if (motion_turned(moment)) return Reason::moving;
  if (group_taken_back(moment)) return Reason::balise_group;
  return std::nullopt;
}

std::optional<Reason> ReportTrigger::due(const Moment& moment) {
  place_locations(moment);
  note_events(moment);
  if (!reported_ || asked_) return Reason::start;
  if (moment.standstill != reported_->standstill) {
    return moment.standstill ? Reason::standstill : Reason::moving;
  }
  if (const auto reason = onboard_reason(moment)) return reason;
  if (const auto reason = correction(moment)) return reason;
  if (group_passed_ && parameters_.m_loc == etcs::kReportAtGroups && !comes_and_goes(moment))
    return Reason::balise_group;
  if (location_passed_) return Reason::location;
  if (cycle_distance_over(moment)) return Reason::cycle_distance;
  if (cycle_time_over(moment)) return Reason::cycle_time;
  return std::nullopt;
}

void ReportTrigger::sent(const Moment& moment) {
  if (reported_ && correction(moment)) corrected_ns_ = moment.now_ns;
  reported_ = moment;
  way_m_ = 0;
  way_to_m_ = moment.front_m;
  asked_ = false;
  group_passed_ = false;
  location_passed_ = false;
  way_lost_ = false;
}

void ReportTrigger::watch(const Moment& moment) {
  place_locations(moment);
  note_events(moment);
  reported_.reset();
  asked_ = group_passed_ = location_passed_ = false;
}

}  // namespace railfix::tpr_publisher
