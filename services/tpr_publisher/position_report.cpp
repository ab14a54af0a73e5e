#include "tpr_publisher/position_report.hpp"

#include <algorithm>
#include <cmath>

#include "core/units.hpp"

namespace railfix::tpr_publisher {

namespace {

using etcs::kUnknownDistance;

constexpr uint32_t kCoarsestScale = 2;
constexpr uint32_t kFastestSteps = 120;  // 600 km/h
constexpr uint32_t kStandBy = 6;         // M_MODE
constexpr uint32_t kSupervisedManoeuvre = 17;

struct Distances {
  uint32_t d_lrbg = kUnknownDistance;
  uint32_t l_doubtover = kUnknownDistance;
  uint32_t l_doubtunder = kUnknownDistance;
  [[nodiscard]] int known() const {
    return (d_lrbg != kUnknownDistance) + (l_doubtover != kUnknownDistance) + (l_doubtunder != kUnknownDistance);
  }
};

/// Steps, or "unknown" for what does not fit (or is not a number).
uint32_t steps_or_unknown(double steps) {
  return steps < kUnknownDistance ? static_cast<uint32_t>(steps) : kUnknownDistance;
}

/// front_m: estimated front end beyond the group, along the train.
Distances distances_in(double step_m, double front_m, double over_m, double under_m) {
  Distances distances;
  distances.d_lrbg = steps_or_unknown(std::round(std::abs(front_m) / step_m));
  if (distances.d_lrbg == kUnknownDistance) return distances;
  const double moved_m = reported_ahead_m(distances.d_lrbg, step_m, front_m);
  distances.l_doubtover = steps_or_unknown(std::ceil(std::max(0.0, over_m + moved_m) / step_m));
  distances.l_doubtunder = steps_or_unknown(std::ceil(std::max(0.0, under_m - moved_m) / step_m));
  return distances;
}

uint32_t side(bool nominal) {
  return nominal ? etcs::kNominal : etcs::kReverse;
}

/// Not when the map does not say of how many balises the group is: then no direction of its own is claimed.
bool has_co_ordinate_system(const track::BaliseGroup& group) {
  return group.is_virtual || group.balises.size() > 1;
}

void refer(const TrainPosition& position, const Reference& reference, Motion motion, const ReportSettings& settings,
           etcs::TrainPositionReport& report) {
  const double front_m = reference.foot_m + settings.foot_to_front_m;
  const auto allowance = train_allowance(settings);
  const double group_m = place_doubt_m(reference);
  const double over_m = amount_m(position.over_m) + group_m + allowance.over_m;
  const double under_m = amount_m(position.under_m) + group_m + allowance.under_m;
  const int best = distances_in(etcs::scale_m(kCoarsestScale), front_m, over_m, under_m).known();
  Distances distances;
  for (uint32_t q_scale = settings.finest_q_scale; q_scale <= kCoarsestScale; ++q_scale) {
    report.q_scale = q_scale;
    distances = distances_in(etcs::scale_m(q_scale), front_m, over_m, under_m);
    if (distances.known() == best) break;
  }
  report.nid_lrbg = reference.group->nid_lrbg();
  report.d_lrbg = distances.d_lrbg;
  report.l_doubtover = distances.l_doubtover;
  report.l_doubtunder = distances.l_doubtunder;

  if (!has_co_ordinate_system(*reference.group)) {
    report.nid_packet = 1;
    report.nid_prvlrbg = reference.previous != nullptr ? reference.previous->nid_lrbg() : etcs::kUnknownBaliseGroup;
  }
  report.q_dirlrbg = orientation(reference);
  if (report.q_dirlrbg == etcs::kUnknownSide) return;
  const bool nominal_along = report.q_dirlrbg == etcs::kNominal;
  report.q_dlrbg = side(nominal_along == (front_m >= 0));
  if (motion != Motion::unknown) report.q_dirtrain = side(nominal_along == (motion == Motion::forward));
}

}  // namespace

double amount_m(double value_m) {
  return value_m >= 0 ? value_m : HUGE_VAL;
}

Allowance train_allowance(const ReportSettings& settings) {
  if (settings.baseline != etcs::Baseline::b4) return {};
  if (settings.m_mode == kSupervisedManoeuvre)
    return {amount_m(settings.train_over_m), amount_m(settings.train_under_m)};
  if (settings.m_mode == kStandBy && !settings.train_data)
    return {std::max(settings.train_over_m, 0.0), std::max(settings.train_under_m, 0.0)};
  return {};
}

uint32_t orientation(const Reference& reference) {
  if (has_co_ordinate_system(*reference.group)) return side(reference.nominal_along);
  return reference.previous != nullptr ? side(reference.from_previous_along) : uint32_t{etcs::kUnknownSide};
}

double place_doubt_m(const Reference& reference) {
  return amount_m(reference.group->q_locacc_m) + amount_m(reference.doubt_m);
}

double reported_ahead_m(uint32_t d_lrbg, double step_m, double front_m) {
  return std::copysign(d_lrbg * step_m, front_m) - front_m;
}

uint32_t v_train(double speed_mps, bool standstill, etcs::Baseline baseline) {
  if (standstill) return baseline == etcs::Baseline::b4 ? etcs::kStandstillSpeed : 0;
  const double steps = std::round(core::kmh_from_mps(std::abs(speed_mps)) / etcs::kSpeedStepKmh);
  return steps < kFastestSteps ? static_cast<uint32_t>(steps) : kFastestSteps;
}

uint32_t t_train(int64_t now_ns) {
  constexpr int64_t kStepNs = 10'000'000;
  return static_cast<uint32_t>(now_ns / kStepNs % etcs::kUnknownTime);
}

etcs::TrainPositionReport make_report(const TrainPosition& position, const std::optional<Reference>& reference,
                                      Motion motion, const ReportSettings& settings, int64_t now_ns) {
  etcs::TrainPositionReport report;
  report.t_train = t_train(now_ns);
  report.nid_engine = settings.nid_engine;
  report.v_train = v_train(position.speed_mps, position.standstill, settings.baseline);
  report.m_mode = settings.m_mode;
  report.m_level = settings.m_level;
  if (settings.m_level == etcs::kLevelNtc) report.nid_ntc = settings.nid_ntc;
  if (position.place_known() && reference) refer(position, *reference, motion, settings, report);
  return report;
}

}  // namespace railfix::tpr_publisher
