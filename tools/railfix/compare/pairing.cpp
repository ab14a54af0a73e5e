#include "compare/pairing.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

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

std::vector<PlacedReport> placed(const std::vector<TimedReport>& reports, const Axes& axes) {
  std::vector<PlacedReport> places;
  for (const auto& report : reports) {
    if (const auto place = axes.place(report)) places.push_back(*place);
  }
  return places;
}

bool interval_known(const PlacedReport& report) {
  return std::isfinite(report.high_m - report.low_m);
}

/// In the last report, when it is no older than `longest_gap_ns`.
bool interval_known_at(const std::vector<PlacedReport>& reports, int64_t stamp_ns, int64_t longest_gap_ns) {
  const auto next = std::upper_bound(reports.begin(), reports.end(), stamp_ns,
                                     [](int64_t ns, const PlacedReport& report) { return ns < report.stamp_ns; });
  if (next == reports.begin()) return false;
  const auto& last = *std::prev(next);
  return stamp_ns - last.stamp_ns <= longest_gap_ns && interval_known(last);
}

}  // namespace

double Pair::difference_m() const {
  const double ahead_m = ours.front_m - certified.front_m;
  return certified.speed_mps < 0 ? -ahead_m : ahead_m;
}

bool Pair::overlap() const {
  return ours.low_m - carried_m <= certified.high_m && certified.low_m <= ours.high_m + carried_m;
}

Pairing pair_up(const std::vector<TimedReport>& ours, const std::vector<TimedReport>& certified, const Axes& axes,
                int64_t longest_gap_ns) {
  const auto own = placed(ours, axes);
  Pairing pairing{{}, {}, 0, own.size(), 0, 0};
  uint32_t group_before = 0;
  for (const auto& timed : certified) {
    const auto place = axes.place(timed);
    if (place && (pairing.legs == 0 || place->nid_lrbg != group_before)) ++pairing.legs;
    pairing.availability.push_back({std::max<size_t>(pairing.legs, 1) - 1,
                                    interval_known_at(own, timed.stamp_ns, longest_gap_ns),
                                    place && interval_known(*place)});
    if (!place) continue;
    ++pairing.certified_placed;
    const auto& report = *place;
    group_before = report.nid_lrbg;
    const auto next = std::lower_bound(own.begin(), own.end(), report.stamp_ns,
                                       [](const PlacedReport& a, int64_t stamp_ns) { return a.stamp_ns < stamp_ns; });
    const bool exact = next != own.end() && next->stamp_ns == report.stamp_ns;
    const auto last = exact ? next : next == own.begin() ? own.end() : std::prev(next);
    const bool usable = next != own.end() && last != own.end() && next->axis == report.axis &&
                        last->axis == report.axis && next->stamp_ns - last->stamp_ns <= longest_gap_ns;
    if (!usable) {
      ++pairing.alone;
      continue;
    }
    Pair pair;
    pair.stamp_ns = report.stamp_ns;
    pair.leg = pairing.legs - 1;
    pair.certified = report;
    pair.ours = carried(*last, *next, report.stamp_ns, pair.carried_m);
    pair.ours_sent = *last;
    pairing.pairs.push_back(pair);
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
