#include "compare/pairing.hpp"

#include <algorithm>
#include <cmath>
#include <optional>

#include "core/time.hpp"
#include "core/units.hpp"
#include "evaluation/truth.hpp"

namespace railfix::compare {

namespace {

constexpr double kSpeedRoundingMps = 2.5 / 3.6;
constexpr double kSamePlaceM = 1;
constexpr double kLargestAccelerationMps2 = 1.5;  // for reports that do not say which way they run

/// Where a time lies between two reports; 0 where they are of one time.
double share_of_gap(const PlacedReport& a, const PlacedReport& b, int64_t stamp_ns) {
  const double gap_s = core::seconds(b.stamp_ns - a.stamp_ns);
  return gap_s > 0 ? core::seconds(stamp_ns - a.stamp_ns) / gap_s : 0;
}

/// Cubic Hermite between two reports; `share` of the way in time.
PlacedReport carried(const PlacedReport& a, const PlacedReport& b, int64_t stamp_ns, double& doubt_m) {
  const double gap_s = core::seconds(b.stamp_ns - a.stamp_ns);
  const double share = share_of_gap(a, b, stamp_ns);
  const double rest = 1 - share;
  PlacedReport at = share < 1 ? a : b;
  at.stamp_ns = stamp_ns;
  const double way_m = b.front_m - a.front_m;
  if (std::isfinite(a.speed_mps) && std::isfinite(b.speed_mps)) {
    const double bend_m = gap_s * share * rest * (a.speed_mps * rest - b.speed_mps * share);
    at.front_m = a.front_m + way_m * share * share * (3 - 2 * share) + bend_m;
    doubt_m = kSpeedRoundingMps * gap_s * share * rest;
  } else {
    at.front_m = a.front_m + way_m * share;
    doubt_m = 0.5 * kLargestAccelerationMps2 * gap_s * gap_s * share * rest;
  }
  const auto mixed = [&](double first_m, double second_m) {
    return share == 0 ? first_m : share == 1 ? second_m : first_m * rest + second_m * share;
  };
  at.low_m = at.front_m - mixed(a.front_m - a.low_m, b.front_m - b.low_m);
  at.high_m = at.front_m + mixed(a.high_m - a.front_m, b.high_m - b.front_m);
  at.speed_mps = mixed(a.speed_mps, b.speed_mps);
  return at;
}

/// What SUBSET-041 allows: 2 km/h below 30 km/h, from there linear to 12 km/h at 500.
double speed_allowance_kmh(double speed_kmh) {
  constexpr double kLowKmh = 30;
  constexpr double kHighKmh = 500;
  return 2 + 10 * std::clamp((speed_kmh - kLowKmh) / (kHighKmh - kLowKmh), 0.0, 1.0);
}

/// Between two reports of ours a train may have braked at any time.
void compare_speeds(const PlacedReport& last, const PlacedReport& next, Pair& pair) {
  const double speed = speed_kmh(pair.certified.fields);
  const auto [low, high] = std::minmax({speed_kmh(last.fields), speed_kmh(next.fields)});
  pair.speed_apart_kmh = std::max({0.0, low - speed, speed - high});
  const double share = share_of_gap(last, next, pair.stamp_ns);
  pair.faster_kmh = speed_kmh(last.fields) * (1 - share) + speed_kmh(next.fields) * share - speed;
}

struct Said {
  int64_t stamp_ns = 0;
  bool position_known = false;
  bool interval_known = false;
  uint64_t system = 0;
  std::optional<PlacedReport> place;
  bool lrbg_on_line = false;
};

/// In packet 1: the line has the LRBG, and not the group before it.
bool came_another_way(const Said& report) {
  return report.position_known && !report.place && report.lrbg_on_line;
}

/// Counts from a group that the line does not have.
bool is_off_line(const Said& report) {
  return report.position_known && !report.place && !report.lrbg_on_line;
}

std::vector<Said> said(const std::vector<TimedReport>& reports, const Axes& axes) {
  std::vector<Said> all;
  all.reserve(reports.size());
  for (const auto& report : reports) {
    const auto& fields = report.fields;
    all.push_back({report.stamp_ns, position_known(fields), interval_known(fields), co_ordinate_system(fields),
                   axes.place(report), axes.place_of(fields.nid_lrbg).has_value()});
  }
  return all;
}

/// Of every certified report: it begins where the LRBG changes.
std::vector<size_t> legs_of(const std::vector<TimedReport>& certified) {
  std::vector<size_t> legs;
  size_t leg = 0;
  std::optional<uint32_t> group_before;
  for (const auto& report : certified) {
    const uint32_t group = report.fields.nid_lrbg;
    if (etcs::names_group(group)) {
      leg += group_before && group != *group_before;
      group_before = group;
    }
    legs.push_back(leg);
  }
  return legs;
}

/// Both stand, and where they say they are is the same.
bool stand_together(const etcs::TrainPositionReport& a, const etcs::TrainPositionReport& b) {
  if (!stands(a) || !stands(b) || a.nid_lrbg != b.nid_lrbg || a.q_dlrbg != b.q_dlrbg) return false;
  const auto a_m = etcs::metres_if_known(a.d_lrbg, a.q_scale);
  const auto b_m = etcs::metres_if_known(b.d_lrbg, b.q_scale);
  return a_m && b_m ? std::abs(*a_m - *b_m) <= kSamePlaceM : !a_m && !b_m;
}

/// Of every certified report. Held against where the stay began: V_TRAIN is 0 for a train that creeps, too.
std::vector<size_t> stays_of(const std::vector<TimedReport>& certified) {
  std::vector<size_t> stays;
  for (size_t i = 0; i < certified.size(); ++i) {
    const bool on = i > 0 && stand_together(certified[stays.back()].fields, certified[i].fields);
    stays.push_back(on ? stays.back() : i);
  }
  return stays;
}

/// That of the last certified report, or of the first one for what lies before.
size_t leg_at(int64_t stamp_ns, const std::vector<TimedReport>& certified, const std::vector<size_t>& legs) {
  const auto later = std::ranges::upper_bound(certified, stamp_ns, {}, &TimedReport::stamp_ns);
  if (legs.empty()) return 0;
  return later == certified.begin() ? legs.front() : legs[static_cast<size_t>(later - certified.begin()) - 1];
}

/// The last report of any kind, for one that says "unknown" ends what the one before it said, and the next one. Both
/// are the same at its very time.
struct Around {
  const Said* last = nullptr;
  const Said* next = nullptr;
};

Around around(const std::vector<Said>& reports, int64_t stamp_ns) {
  const auto later = std::upper_bound(reports.begin(), reports.end(), stamp_ns,
                                      [](int64_t ns, const Said& report) { return ns < report.stamp_ns; });
  Around found;
  if (later != reports.end()) found.next = &*later;
  if (later != reports.begin()) found.last = &*std::prev(later);
  if (found.last != nullptr && found.last->stamp_ns == stamp_ns) found.next = found.last;
  return found;
}

/// When the certified system reports: its gaps that can be carried over, in the time of both logs.
std::vector<evaluation::Stretch> reported(const std::vector<TimedReport>& ours,
                                          const std::vector<TimedReport>& certified, int64_t longest_gap_ns) {
  std::vector<evaluation::Stretch> stretches;
  if (ours.empty() || certified.empty()) return stretches;
  for (size_t i = 1; i < certified.size(); ++i) {
    if (certified[i].stamp_ns - certified[i - 1].stamp_ns > longest_gap_ns) continue;
    const evaluation::Stretch both{std::max(certified[i - 1].stamp_ns, ours.front().stamp_ns),
                                   std::min(certified[i].stamp_ns, ours.back().stamp_ns)};
    if (both.from_ns < both.to_ns) stretches.push_back(both);
  }
  return stretches;
}

double every_s(const std::vector<TimedReport>& reports, const std::vector<evaluation::Stretch>& stretches) {
  double sum_s = 0;
  double squares = 0;
  auto first = stretches.begin();
  for (size_t i = 1; i < reports.size(); ++i) {
    const int64_t begin_ns = reports[i - 1].stamp_ns;
    const int64_t end_ns = reports[i].stamp_ns;
    while (first != stretches.end() && first->to_ns <= begin_ns) ++first;
    double gap_s = 0;
    for (auto at = first; at != stretches.end() && at->from_ns < end_ns; ++at)
      gap_s += core::seconds(std::min(end_ns, at->to_ns) - std::max(begin_ns, at->from_ns));
    sum_s += gap_s;
    squares += gap_s * gap_s;
  }
  return squares / sum_s;
}

bool comparable(const Said& a, const Said& b) {
  return a.place && b.place && a.place->axis == b.place->axis;
}

/// A group that the map lacks is no fault of the reports.
bool name_the_same(const Said& a, const Said& b) {
  return a.position_known && b.position_known && a.system == b.system;
}

/// With one of three certified reports in a row.
bool has_in_common(const Said& ours, const std::vector<Said>& certified, size_t middle) {
  const size_t last = std::min(middle + 1, certified.size() - 1);
  for (size_t i = middle - std::min<size_t>(middle, 1); i <= last; ++i) {
    if (comparable(ours, certified[i]) || name_the_same(ours, certified[i])) return true;
  }
  return false;
}

/// Of a certified report with a position that has no partner.
Beside beside_alone(const Around& ours, const std::vector<Said>& certified, size_t i, int64_t longest_gap_ns) {
  const auto* last = ours.last;
  const auto* next = ours.next;
  const bool lately = last != nullptr && certified[i].stamp_ns - last->stamp_ns <= longest_gap_ns;
  if (!lately || !last->position_known) return Beside::unknown;
  const auto leaves_line = [&](const Said& one) { return is_off_line(one) && !has_in_common(one, certified, i); };
  if (certified[i].place && (leaves_line(*last) || (next != nullptr && leaves_line(*next)))) return Beside::off_line;
  if (came_another_way(certified[i]) || came_another_way(*last) || (next != nullptr && came_another_way(*next)))
    return Beside::silent;
  if (next != nullptr && (!next->position_known || next->stamp_ns - last->stamp_ns > longest_gap_ns))
    return Beside::silent;
  return has_in_common(*last, certified, i) ? Beside::passing : Beside::other_group;
}

/// Ours at the time of a certified report.
std::optional<Pair> paired(const Around& ours, const PlacedReport& certified, int64_t longest_gap_ns) {
  if (ours.last == nullptr || ours.next == nullptr || !ours.last->place || !ours.next->place) return std::nullopt;
  const auto& last = *ours.last->place;
  const auto& next = *ours.next->place;
  const bool usable =
      last.axis == certified.axis && next.axis == certified.axis && next.stamp_ns - last.stamp_ns <= longest_gap_ns;
  if (!usable) return std::nullopt;
  Pair pair;
  pair.stamp_ns = certified.stamp_ns;
  pair.certified = certified;
  pair.ours = carried(last, next, certified.stamp_ns, pair.carried_m);
  pair.ours_sent = last;
  compare_speeds(last, next, pair);
  return pair;
}

constexpr double kGroupsOffM = 12;  // Q_LOCACC of a group whose linking is not known
constexpr double kWaysApartM = 50;  // by which a way on the map may be longer than as it was run
constexpr double kWaysApartShare = 0.02;

/// By report: the train passed the LRBG under way and has not turned back since, as far as this side says, without a
/// silence.
std::vector<bool> passed_straight_on(const std::vector<TimedReport>& reports, int64_t longest_gap_ns) {
  std::vector<bool> straight(reports.size());
  for (size_t i = 1; i < reports.size(); ++i) {
    const auto& before = reports[i - 1].fields;
    const auto& now = reports[i].fields;
    const bool away = now.q_dirtrain != etcs::kUnknownSide && now.q_dirtrain == now.q_dlrbg;
    const bool same = before.nid_lrbg == now.nid_lrbg;
    const bool silent = reports[i].stamp_ns - reports[i - 1].stamp_ns > longest_gap_ns;
    straight[i] =
        away && !silent && (same ? straight[i - 1] && before.q_dirtrain == now.q_dirtrain : position_known(before));
  }
  return straight;
}

/// One side's reports.
struct Side {
  const std::vector<TimedReport>& reports;
  const std::vector<Said>& said;
  std::vector<bool> straight;
};

/// OffLine::beside_line.
bool beside_line(const Said& report, const std::vector<Said>& others, int64_t longest_gap_ns) {
  const auto [last, next] = around(others, report.stamp_ns);
  if (last == nullptr || next == nullptr || !last->place || !next->place) return false;
  return report.stamp_ns - last->stamp_ns <= longest_gap_ns &&
         !has_in_common(report, others, static_cast<size_t>(last - others.data()));
}

/// OffLine::contradicted_by of report `i`, which names a group of another track.
std::optional<PlacedReport> contradiction(const Side& side, size_t i, const Side& others, const Axes& axes,
                                          int64_t longest_gap_ns) {
  const auto& fields = side.reports[i].fields;
  const auto [last, next] = around(others.said, side.said[i].stamp_ns);
  if (last == nullptr || next == nullptr || !last->place || !next->place) return std::nullopt;
  if (next->stamp_ns - last->stamp_ns > longest_gap_ns) return std::nullopt;
  if (!side.straight[i] || !others.straight[static_cast<size_t>(last - others.said.data())]) return std::nullopt;
  double carried_m = 0;
  auto other = carried(*last->place, *next->place, side.said[i].stamp_ns, carried_m);
  const auto over_m = etcs::metres_if_known(fields.l_doubtover, fields.q_scale);
  const auto under_m = etcs::metres_if_known(fields.l_doubtunder, fields.q_scale);
  const auto& others_fields = last->place->fields;
  const auto beyond = axes.place_of(others_fields.nid_lrbg);
  if (!over_m || !under_m || !beyond || !std::isfinite(other.high_m - other.low_m)) return std::nullopt;
  const double passed_m = other.front_m - last->place->running * etcs::metres(fields.d_lrbg, fields.q_scale);
  const double apart_m = std::abs(passed_m - *beyond);
  const double doubt_m = *over_m + *under_m + (other.high_m - other.low_m) + carried_m + 2 * kGroupsOffM;
  const double longest_m = apart_m * (1 + kWaysApartShare) + doubt_m + kWaysApartM;
  if (!axes.network().no_way(others_fields.nid_lrbg, fields.nid_lrbg, longest_m)) return std::nullopt;
  return other;
}

/// Places of one side, and what it says of groups that the line does not have.
void count(const Side& side, const Side& others, const Axes& axes, int64_t longest_gap_ns,
           const std::function<size_t(size_t)>& leg_of, Counted& counted) {
  const auto& said = side.said;
  for (size_t i = 0; i < said.size(); ++i) {
    if (said[i].place) counted.placed.push_back({leg_of(i), *said[i].place});
    if (!is_off_line(said[i])) continue;
    OffLine off_line{leg_of(i), said[i].stamp_ns, beside_line(said[i], others.said, longest_gap_ns), std::nullopt};
    if (off_line.beside_line && axes.names_other_track(side.reports[i].fields))
      off_line.contradicted_by = contradiction(side, i, others, axes, longest_gap_ns);
    counted.off_line.push_back(off_line);
  }
}

}  // namespace

double Pair::difference_m() const {
  return certified.running * (ours.front_m - certified.front_m);
}

bool Pair::overlap() const {
  return ours.low_m - carried_m <= certified.high_m && certified.low_m <= ours.high_m + carried_m;
}

bool Pair::turned() const {
  return ours.facing * certified.facing < 0;
}

bool Pair::runs_apart() const {
  return ours.speed_mps * certified.speed_mps < 0;
}

bool Pair::speeds_apart() const {
  constexpr double kRoundingKmh = etcs::kSpeedStepKmh / 2.0;
  return speed_apart_kmh > 2 * (kRoundingKmh + speed_allowance_kmh(speed_kmh(certified.fields)));
}

Pairing pair_up(const std::vector<TimedReport>& ours, const std::vector<TimedReport>& certified, const Axes& axes,
                int64_t longest_gap_ns, std::optional<int64_t> ours_until_ns) {
  Pairing pairing;
  const auto legs = legs_of(certified);
  const auto stays = stays_of(certified);
  const auto own = said(ours, axes);
  const auto theirs = said(certified, axes);
  const auto leg_of_ours = [&](size_t i) { return leg_at(ours[i].stamp_ns, certified, legs); };
  const Side our_side{ours, own, passed_straight_on(ours, longest_gap_ns)};
  const Side their_side{certified, theirs, passed_straight_on(certified, longest_gap_ns)};
  count(our_side, their_side, axes, longest_gap_ns, leg_of_ours, pairing.ours);
  count(
      their_side, our_side, axes, longest_gap_ns, [&](size_t i) { return legs[i]; }, pairing.certified);
  const int64_t until_ns = own.empty() ? 0 : std::max(own.back().stamp_ns, ours_until_ns.value_or(own.back().stamp_ns));
  for (size_t i = 0; i < theirs.size(); ++i) {
    const Said& report = theirs[i];
    const int64_t stamp_ns = report.stamp_ns;
    const bool outside =
        !own.empty() && (stamp_ns < own.front().stamp_ns - longest_gap_ns || stamp_ns > until_ns + longest_gap_ns);
    if (outside) {  // a log that begins late or ends early says nothing about the system
      ++pairing.outside_ours;
      continue;
    }
    const auto beside = around(own, stamp_ns);
    const bool fresh = beside.last != nullptr && stamp_ns - beside.last->stamp_ns <= longest_gap_ns;
    pairing.availability.push_back({legs[i], stays[i], fresh && beside.last->interval_known, report.interval_known});
    if (!report.position_known) continue;
    auto pair = report.place ? paired(beside, *report.place, longest_gap_ns) : std::nullopt;
    pairing.beside.push_back({legs[i], pair ? Beside::paired : beside_alone(beside, theirs, i, longest_gap_ns)});
    if (!pair) {
      pairing.alone += report.place.has_value();
      continue;
    }
    pair->leg = legs[i];
    pair->stay = stays[i];
    pairing.legs += pairing.pairs.empty() || pairing.pairs.back().leg != legs[i];
    pairing.pairs.push_back(*pair);
  }
  const auto stretches = reported(ours, certified, longest_gap_ns);
  pairing.ours.every_s = every_s(ours, stretches);
  pairing.certified.every_s = every_s(certified, stretches);
  return pairing;
}

}  // namespace railfix::compare
