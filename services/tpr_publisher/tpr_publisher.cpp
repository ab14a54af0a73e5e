#include "tpr_publisher/tpr_publisher.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <utility>

#include "core/time.hpp"
#include "core/train_limits.hpp"

namespace railfix::tpr_publisher {

namespace {

constexpr int64_t kOldestNs = core::kNsPerSecond;
constexpr int64_t kOtherTimeNs = 3600 * core::kNsPerSecond;
// Of a train that comes to rest the estimated speed may have any sign: its direction is that of its way.
constexpr double kSurelyMovesMps = 1.0;
constexpr int64_t kTrainborneStepNs = 10'000'000;  // T_TRAIN
constexpr double kRollsM = 2.0;                    // the other way without a rest that was seen
constexpr double kMovesM = 0.04;     // by 5 cm fusion ends a rest: it is known by then which way they were
constexpr double kForgetsS = 5;      // at rest: an error of the speed adds up to no way
constexpr double kCorrectionM = 20;  // a distance may be corrected by so much, and by what it was not sure of

std::string not_sent(const std::string& why) {
  return "Position report not sent: " + why;
}

Outcome no_report(bool due, const std::string& why) {
  return {std::nullopt, due ? not_sent(why) : "No position report can be sent: " + why};
}

/// Why no report can be made of it; empty when the position is young enough.
std::string too_old(int64_t stamp_ns, int64_t now_ns) {
  const int64_t age_ns = now_ns - stamp_ns;
  if (age_ns < kOldestNs && age_ns > -kOldestNs) return "";
  if (std::abs(age_ns) > kOtherTimeNs)
    return "the last train_state is of another time; played data has not said yet which time it is there, or a host's "
           "clock is wrong.";
  char text[160];
  if (age_ns > 0) {
    std::snprintf(text, sizeof text, "the last train_state is %.1f s old, the limit is 1 s.", core::seconds(age_ns));
  } else {
    std::snprintf(text, sizeof text, "the last train_state lies %.1f s in the future; synchronise the hosts' clocks.",
                  -core::seconds(age_ns));
  }
  return text;
}

double doubt_m(const TrainPosition& position) {
  const double doubt_m = std::max(position.over_m, position.under_m);
  return std::isfinite(doubt_m) ? std::max(doubt_m, 0.0) : 0.0;
}

/// The travelled distance of both counts from one origin, and nothing is missing between them. Not so when fusion was
/// away and has nobody to go on from (its distance begins again at 0), has guessed how far the train went meanwhile, or
/// a clock was set.
bool goes_on(const TrainPosition& last, const TrainPosition& now) {
  const int64_t since_ns = now.stamp_ns - last.stamp_ns;
  if (since_ns < 0 || since_ns > kOldestNs) return false;
  const double most_m = core::kFastestTrainMps * core::seconds(since_ns) + kCorrectionM + doubt_m(last) + doubt_m(now);
  return std::abs(now.distance_m - last.distance_m) <= most_m;
}

bool is_number(const TrainPosition& position) {
  return !std::isinf(position.speed_mps) && std::isfinite(position.distance_m);
}

}  // namespace

TprPublisher::TprPublisher(std::shared_ptr<const track::Map> map, const Settings& settings)
    : settings_(settings),
      trigger_(settings.parameters, settings.train_length_m),
      ends_{settings.report.foot_to_front_m, settings.foot_to_rear_m} {
  if (map) tracker_.emplace(std::move(map), settings.search_behind_m);
  const auto trial = make_report({}, std::nullopt, Motion::unknown, settings.report, 0);
  core::value_or_throw(etcs::encode(trial, settings.report.baseline));
}

void TprPublisher::follow(const TrainPosition& position) {
  const bool heard = !position_ || goes_on(*position_, position);
  if (!heard) {
    integrity_.lose_way();
    trigger_.lose_way();
  }
  const auto position_before = std::exchange(position_, position);
  const auto* group_before = reference_ ? reference_->group : nullptr;
  const bool followed = heard && position_before;
  follow_motion(position,
                followed ? std::optional(core::seconds(position.stamp_ns - position_before->stamp_ns)) : std::nullopt);
  if (tracker_) {
    if (position.place_known()) {
      tracker_->update(position.foot, position.track_declared(), heard);
    } else {
      tracker_->lose();
    }
    reference_ = tracker_->reference();
  }
  const bool guessed = position.place_known() && !position.track_declared();
  const bool same_group = reference_ && reference_->group == group_before;
  doubt_.follow(position, reference_ ? std::optional(reference_->foot_m) : std::nullopt, same_group, !guessed);
  // 4.0.0 only: a train that has backed is not taken for complete (3.6.5.2, table 2c [8]).
  const bool backs = !position.standstill && motion() == Motion::backward;
  if (backs && settings_.report.baseline == etcs::Baseline::b4) integrity_.use_up();
  if (position.usable) {
    auto place = place_of_now();
    if (followed) place.moved_m = moved_m(*position_before);
    integrity_.follow(place);
  } else {
    integrity_.lose_way();
  }
}

// By the speed, because what the distance is corrected by is no way.
void TprPublisher::follow_motion(const TrainPosition& position, std::optional<double> since_s) {
  if (!since_s || std::isnan(position.speed_mps)) {
    motion_ = Motion::unknown;
    way_m_ = 0;
  } else {
    if (position.standstill) way_m_ -= way_m_ * *since_s / kForgetsS;
    way_m_ += position.speed_mps * *since_s;
  }
  rested_ = rested_ || position.standstill;
  if (position.standstill) return;
  const bool fast = std::abs(position.speed_mps) >= kSurelyMovesMps;
  const Motion moves = (fast ? position.speed_mps : way_m_) > 0 ? Motion::forward : Motion::backward;
  const bool agree = std::abs(way_m_) >= kMovesM && way_m_ * position.speed_mps > 0;
  // No train turns round without coming to rest; an estimate that is corrected while it brakes does.
  // Nor may a rest have been seen where it rolls back at once.
  const bool turns = agree && (rested_ || motion_ == Motion::unknown || std::abs(way_m_) >= kRollsM);
  if (moves != motion_ && !fast && !turns) return;
  rested_ = rested_ && !fast && !agree;
  motion_ = moves;
  way_m_ = 0;
}

TrainPosition TprPublisher::doubted_position() const {
  auto position = *position_;
  position.over_m = doubt_.over_m();
  position.under_m = doubt_.under_m();
  return is_turned() ? turned(position) : position;
}

std::optional<Reference> TprPublisher::along_train(std::optional<Reference> found) const {
  if (!found || !ends_.to_front_m(cab_)) return std::nullopt;
  return is_turned() ? turned(std::move(*found)) : found;
}

std::optional<Reference> TprPublisher::reference(std::optional<uint32_t> group) const {
  const bool named = group && *group != etcs::kUnknownBaliseGroup;
  return named ? find(*group, std::nullopt) : along_train(reference_);
}

std::optional<Reference> TprPublisher::find(uint32_t group, std::optional<double> expected_foot_m) const {
  if (!tracker_) return std::nullopt;
  if (expected_foot_m && is_turned()) expected_foot_m = -*expected_foot_m;
  const double ahead_m = ReportTrigger::kOriginWaitM + std::max(ends_.to_front_m(cab_).value_or(0), 0.0);
  return along_train(tracker_->find(group, ahead_m, expected_foot_m));
}

double TprPublisher::group_m() const {
  return reference_ ? place_doubt_m(*reference_) : 0.0;
}

TrainIntegrity::Place TprPublisher::place_of_now() const {
  const auto position = doubted_position();
  return {position.stamp_ns, position.distance_m,
          amount_m(position.over_m) + group_m() + train_allowance(settings_.report).over_m, position.place_known()};
}

double TprPublisher::moved_m(const TrainPosition& before) const {
  if (!tracker_ || (!before.place_known() && !position_->place_known())) return 0;
  if (!tracker_->step_m()) return HUGE_VAL;
  const double moved_m = *tracker_->step_m() - (position_->distance_m - before.distance_m);
  return is_turned() ? -moved_m : moved_m;
}

uint32_t TprPublisher::orientation_to(std::optional<uint32_t> group) const {
  const auto there = reference(group);
  return there ? orientation(*there) : uint32_t{etcs::kUnknownSide};
}

bool TprPublisher::direction_known(std::optional<uint32_t> origin) const {
  return orientation_to(origin) != etcs::kUnknownSide;
}

core::Status TprPublisher::set_parameters(const etcs::ReportParameters& parameters, std::optional<uint32_t> origin,
                                          bool waited) {
  if (parameters.q_dir != etcs::kUnknownSide) {  // here the value 2 says "both"
    const uint32_t looks = orientation_to(origin);
    if (looks == etcs::kUnknownSide)
      return core::Error{"Packet 58 is for one direction only (Q_DIR), but the train's is not known yet."};
    if (looks != parameters.q_dir)
      return core::Error{"Packet 58 is for trains of the other direction (Q_DIR) than this one's."};
  }
  trigger_.set_parameters(parameters, origin, waited);
  return {};
}

etcs::TrainPositionReport TprPublisher::fields(int64_t now_ns) const {
  const auto position = doubted_position();
  auto settings = settings_.report;
  settings.foot_to_front_m = ends_.to_front_m(cab_).value_or(0);
  const auto here = reference();
  auto fields = make_report(position, here, motion(), settings, trainborne_ns(now_ns));
  if (onboard_silent(now_ns)) return fields;
  double ahead_m = 0;
  if (here && fields.d_lrbg != etcs::kUnknownDistance) {  // trackside counts the length from the front end it was told
    const double front_m = here->foot_m + settings.foot_to_front_m;
    ahead_m = reported_ahead_m(fields.d_lrbg, etcs::scale_m(fields.q_scale), front_m);
  }
  const auto said = integrity_.said(position.distance_m, ahead_m);
  // Nobody can place a length from a front end that is not referred to a group (3.6.5.2.7).
  if (said.l_trainint && fields.nid_lrbg == etcs::kUnknownBaliseGroup) return fields;
  fields.q_length = said.q_length;
  fields.l_trainint = said.l_trainint;
  return fields;
}

std::optional<Reference> TprPublisher::trigger_origin(double foot_m) const {
  const auto origin = trigger_.origin();
  if (!origin) return std::nullopt;
  const auto origin_m = trigger_.origin_m();
  return find(*origin, origin_m ? std::optional(foot_m - *origin_m) : std::nullopt);
}

Moment TprPublisher::moment(int64_t now_ns) const {
  Moment moment;
  moment.now_ns = now_ns;
  const auto position = doubted_position();
  const double to_front_m = ends_.to_front_m(cab_).value_or(0);
  moment.standstill = position.standstill;
  moment.motion = motion();
  moment.foot_to_front_m = to_front_m;
  moment.front_m = position.distance_m + to_front_m;
  moment.max_safe_front_m =
      moment.front_m + amount_m(position.under_m) + group_m() + train_allowance(settings_.report).under_m;
  moment.min_safe_front_m = moment.front_m - place_of_now().over_m;
  moment.taken_back = tracker_ ? tracker_->taken_back() : 0;
  moment.passed_again = tracker_ ? tracker_->passed_again() : 0;
  if (const auto here = reference()) {
    moment.nid_lrbg = here->group->nid_lrbg();
    moment.q_dirlrbg = orientation(*here);
    const auto there = trigger_origin(position.distance_m);
    if (there) {
      moment.beyond_origin_m = there->foot_m + to_front_m;
      moment.origin_doubt_m = std::max(there->doubt_m - here->doubt_m, 0.0);
    }
    // A group behind a train on a leg that is guessed is not found, and not known to be nowhere either.
    if (position_->track_declared() || !trigger_.origin() || there) moment.beyond_lrbg_m = here->foot_m + to_front_m;
  }
  if (onboard_) {
    moment.onboard = *onboard_;
    // As in fields(): what is said again after a silence is news for the trackside.
    moment.onboard.q_integrity = onboard_silent(now_ns) ? etcs::kNoIntegrityInformation : integrity_.q_integrity();
    moment.onboard.integrity_ns = integrity_.integrity_ns();
  }
  moment.mode_changes = mode_changes_;
  moment.level_changes = level_changes_;
  moment.wants = wants_;
  moment.wanted_because = wanted_because_;
  return moment;
}

void TprPublisher::watch(const TrainPosition& position, int64_t now_ns) {
  if (!is_number(position)) return;
  follow(position);
  trigger_.watch(moment(now_ns));
}

Outcome TprPublisher::update(const TrainPosition& position, int64_t now_ns) {
  if (!is_number(position)) {
    return {std::nullopt, not_sent("speed or distance of the train_state is not a number.")};
  }
  follow(position);
  const auto now = moment(now_ns);
  const auto reason = trigger_.due(now);
  if (const auto why = too_old(position.stamp_ns, now_ns); !why.empty()) return no_report(reason.has_value(), why);
  if (!reason) return {};
  if (std::isnan(position.speed_mps) && !position.standstill)
    return {std::nullopt, not_sent("the speed is not known, and V_TRAIN has no value that says so.")};
  Report report{position.stamp_ns, now_ns, *reason, fields(now_ns), {}};
  auto message = etcs::encode(report.fields, settings_.report.baseline);
  if (!message.ok()) return {std::nullopt, not_sent(message.error().message)};
  report.message = std::move(message).value();
  sent(report, now);
  return {std::move(report), ""};
}

// A clock that was set back is taken on from where it was.
// A position may be ahead of this clock.
int64_t TprPublisher::trainborne_ns(int64_t now_ns) const {
  return std::max(std::max(now_ns, position_->stamp_ns) + trainborne_ahead_ns_,
                  sent_trainborne_ns_ + kTrainborneStepNs);
}

void TprPublisher::hear_trainborne(uint32_t t_train_heard, int64_t now_ns) {
  if (t_train_heard >= etcs::kUnknownTime) return;
  int64_t ahead = int64_t{t_train_heard} - t_train(now_ns);
  constexpr int64_t kPeriod = etcs::kUnknownTime;  // it starts anew
  if (ahead > kPeriod / 2) ahead -= kPeriod;
  if (ahead < -kPeriod / 2) ahead += kPeriod;
  sent_trainborne_ns_ = std::max(sent_trainborne_ns_, now_ns + ahead * kTrainborneStepNs);
}

void TprPublisher::hear_confirmed(int64_t stamp_ns) {
  if (settings_.report.baseline == etcs::Baseline::b4) integrity_.use_up_until(stamp_ns);
}

void TprPublisher::sent(const Report& report, const Moment& moment) {
  trigger_.sent(moment);
  sent_trainborne_ns_ = trainborne_ns(report.sent_ns);
  trainborne_ahead_ns_ = sent_trainborne_ns_ - std::max(report.sent_ns, report.stamp_ns);
  if (settings_.report.baseline == etcs::Baseline::b4 && is_confirmed(report.fields.q_length)) integrity_.use_up();
}

Outcome TprPublisher::tick(int64_t now_ns) {
  if (!position_) return {std::nullopt, not_sent("no train_state yet.")};
  const auto why = too_old(position_->stamp_ns, now_ns);
  return why.empty() ? Outcome{} : no_report(trigger_.due(moment(now_ns)).has_value(), why);
}

}  // namespace railfix::tpr_publisher
