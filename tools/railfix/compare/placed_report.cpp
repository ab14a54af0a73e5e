#include "compare/placed_report.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "core/units.hpp"

namespace railfix::compare {

namespace {

/// Along the group's nominal direction.
double speed_mps(const etcs::TrainPositionReport& fields) {
  if (stands(fields)) return 0;
  if (fields.q_dirtrain == etcs::kUnknownSide) return std::numeric_limits<double>::quiet_NaN();
  const double speed = core::mps_from_kmh(speed_kmh(fields));
  return fields.q_dirtrain == etcs::kNominal ? speed : -speed;
}

/// Along the group's nominal direction: 1 or -1, 0 = not known.
double facing(const etcs::TrainPositionReport& fields) {
  return fields.q_dirlrbg == etcs::kUnknownSide ? 0 : fields.q_dirlrbg == etcs::kReverse ? -1 : 1;
}

/// Along the group's nominal direction: 1 or -1.
double running(const etcs::TrainPositionReport& fields) {
  const uint32_t way = fields.q_dirtrain == etcs::kUnknownSide ? fields.q_dirlrbg : fields.q_dirtrain;
  return way == etcs::kReverse ? -1 : 1;
}

}  // namespace

bool position_known(const etcs::TrainPositionReport& fields) {
  return etcs::names_group(fields.nid_lrbg) && fields.d_lrbg != etcs::kUnknownDistance &&
         fields.q_dlrbg != etcs::kUnknownSide && (!fields.nid_prvlrbg || etcs::names_group(*fields.nid_prvlrbg));
}

bool interval_known(const etcs::TrainPositionReport& fields) {
  return position_known(fields) && fields.l_doubtover != etcs::kUnknownDistance &&
         fields.l_doubtunder != etcs::kUnknownDistance;
}

uint64_t co_ordinate_system(const etcs::TrainPositionReport& fields) {
  const uint64_t before = fields.nid_prvlrbg ? *fields.nid_prvlrbg + 1U : 0U;
  return before << 24U | fields.nid_lrbg;
}

bool stands(const etcs::TrainPositionReport& fields) {
  return fields.v_train == etcs::kStandstillSpeed || fields.v_train == 0;
}

double speed_kmh(const etcs::TrainPositionReport& fields) {
  return stands(fields) ? 0 : fields.v_train * etcs::kSpeedStepKmh;
}

Axes::Axes(const track::Path& path) : line_(std::in_place), network_(path.map()) {
  for (const auto& mark : path.balise_groups())
    line_->insert({mark.group->nid_lrbg(), {mark.distance_m, mark.nominal_is_along_path}});
}

std::optional<double> Axes::place_of(uint32_t nid_lrbg) const {
  if (!line_ || !line_->contains(nid_lrbg)) return std::nullopt;
  return line_->at(nid_lrbg).at_m;
}

/// The one before (NID_PRVLRBG) may be of the way by which the train came to the line.
bool Axes::names_other_track(const etcs::TrainPositionReport& fields) const {
  return line_ && !line_->contains(fields.nid_lrbg) && network_.has(fields.nid_lrbg);
}

/// The LRBG, and whether "nominal" is along the line.
std::optional<Axes::Group> Axes::on_line(const etcs::TrainPositionReport& fields) const {
  const auto lrbg = line_->find(fields.nid_lrbg);
  if (lrbg == line_->end()) return std::nullopt;
  if (!fields.nid_prvlrbg) return lrbg->second;
  const auto previous = line_->find(*fields.nid_prvlrbg);
  if (previous == line_->end() || previous == lrbg) return std::nullopt;
  // The way from the group before is nominal, whatever the direction of the group itself (SUBSET-026 3.4.2.3.3).
  return Group{lrbg->second.at_m, previous->second.at_m < lrbg->second.at_m};
}

std::optional<PlacedReport> Axes::place(const TimedReport& report) const {
  const auto& fields = report.fields;
  if (!position_known(fields)) return std::nullopt;
  const double front_m = etcs::metres(fields.d_lrbg, fields.q_scale) * (fields.q_dlrbg == etcs::kNominal ? 1 : -1);
  // Behind and ahead of the train's front end; not known = it may be anywhere there.
  double behind_m = etcs::metres_if_known(fields.l_doubtover, fields.q_scale).value_or(HUGE_VAL);
  double ahead_m = etcs::metres_if_known(fields.l_doubtunder, fields.q_scale).value_or(HUGE_VAL);
  if (fields.q_dirlrbg == etcs::kUnknownSide) behind_m = ahead_m = std::max(behind_m, ahead_m);
  if (fields.q_dirlrbg == etcs::kReverse) std::swap(behind_m, ahead_m);
  PlacedReport placed{
      report.stamp_ns,   co_ordinate_system(fields), fields.nid_lrbg, front_m,         front_m - behind_m,
      front_m + ahead_m, speed_mps(fields),          facing(fields),  running(fields), fields};
  if (!line_) return placed;
  const auto group = on_line(fields);
  if (!group) return std::nullopt;
  const double sign = group->along ? 1 : -1;
  placed.axis = 0;
  placed.front_m = group->at_m + sign * placed.front_m;
  placed.speed_mps *= sign;
  placed.facing *= sign;
  placed.running *= sign;
  if (sign < 0) std::swap(behind_m, ahead_m);
  placed.low_m = placed.front_m - behind_m;
  placed.high_m = placed.front_m + ahead_m;
  return placed;
}

}  // namespace railfix::compare
