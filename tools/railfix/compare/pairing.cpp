#include "compare/pairing.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>

#include "core/time.hpp"
#include "core/units.hpp"

namespace railfix::compare {

namespace {

constexpr double kSpeedRoundingMps = 2.5 / 3.6;
constexpr double kLargestAccelerationMps2 = 1.5;  // for reports that do not say which way they run

/// Cubic Hermite between two reports; `share` of the way in time.
PlacedReport carried(const PlacedReport& a, const PlacedReport& b, int64_t stamp_ns, double& doubt_m) {
  const double gap_s = core::seconds(b.stamp_ns - a.stamp_ns);
  const double share = gap_s > 0 ? core::seconds(stamp_ns - a.stamp_ns) / gap_s : 0;
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

struct Said {
  int64_t stamp_ns = 0;
  bool interval_known = false;
  std::optional<PlacedReport> place;
};

Said said(const TimedReport& report, const Axes& axes, Counted& counted) {
  Said said{report.stamp_ns, interval_known(report.fields), axes.place(report)};
  counted.placed += said.place.has_value();
  counted.off_line += !said.place && position_known(report.fields);
  return said;
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
  return pair;
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

Pairing pair_up(const std::vector<TimedReport>& ours, const std::vector<TimedReport>& certified, const Axes& axes,
                int64_t longest_gap_ns) {
  Pairing pairing;
  std::vector<Said> own;
  own.reserve(ours.size());
  for (const auto& report : ours) own.push_back(said(report, axes, pairing.ours));
  size_t leg = 0;
  std::optional<uint32_t> group_before;
  for (const auto& timed : certified) {
    const uint32_t group = timed.fields.nid_lrbg;
    if (etcs::names_group(group)) {
      leg += group_before && group != *group_before;
      group_before = group;
    }
    const auto report = said(timed, axes, pairing.certified);
    const auto beside = around(own, timed.stamp_ns);
    const bool fresh = beside.last != nullptr && timed.stamp_ns - beside.last->stamp_ns <= longest_gap_ns;
    pairing.availability.push_back({leg, fresh && beside.last->interval_known, report.interval_known});
    if (!report.place) continue;
    auto pair = paired(beside, *report.place, longest_gap_ns);
    if (!pair) {
      ++pairing.alone;
      continue;
    }
    pair->leg = leg;
    pairing.legs += pairing.pairs.empty() || pairing.pairs.back().leg != leg;
    pairing.pairs.push_back(*pair);
  }
  return pairing;
}

TimeShift time_shift(const std::vector<Pair>& pairs) {
  const double unknown = std::numeric_limits<double>::quiet_NaN();
  double n = 0;
  double mean_v = 0;
  double mean_d = 0;
  for (const auto& pair : pairs) {
    if (!std::isfinite(pair.certified.speed_mps)) continue;
    ++n;
    mean_v += (std::abs(pair.certified.speed_mps) - mean_v) / n;
    mean_d += (pair.difference_m() - mean_d) / n;
  }
  double vv = 0;
  double vd = 0;
  double dd = 0;
  for (const auto& pair : pairs) {
    if (!std::isfinite(pair.certified.speed_mps)) continue;
    const double v = std::abs(pair.certified.speed_mps) - mean_v;
    const double d = pair.difference_m() - mean_d;
    vv += v * v;
    vd += v * d;
    dd += d * d;
  }
  if (n < 3 || vv < 1) return {unknown, unknown};
  const double shift_s = vd / vv;
  return {shift_s, std::sqrt(std::max(0.0, dd - shift_s * vd) / (n - 2) / vv)};
}

}  // namespace railfix::compare
