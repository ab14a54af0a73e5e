#include "compare/doubts.hpp"

#include <algorithm>
#include <cmath>
#include <map>
#include <set>

#include "evaluation/statistics.hpp"

namespace railfix::compare {

namespace {

constexpr double kSeldom = 1.1;
constexpr double kSigmas = 3;
constexpr double kLeastShiftS = 1e-3;  // rounding alone is no shift
constexpr double kSmall = 0.2;         // a fifth of the error makes 2 % of its root mean square

/// What a shift of the stamps is held against: the certified system's error, or without a truth half its interval.
double certified_size_m(const std::vector<Pair>& pairs, const std::optional<Judge>& judge) {
  std::vector<double> sizes;
  for (const auto& pair : pairs) {
    const auto& report = pair.certified;
    sizes.push_back(judge ? judge->error_m(report) : (report.high_m - report.low_m) / 2);
  }
  return evaluation::root_mean_square(sizes);
}

std::optional<StampsOff> stamps_off(const std::vector<Pair>& pairs, const std::optional<Judge>& judge,
                                    double offset_s) {
  const auto shift = judge ? shift_to_truth(pairs, *judge) : time_shift(pairs);
  if (!(std::abs(shift.shift_s) > std::max(kSigmas * shift.sigma_s, kLeastShiftS))) return std::nullopt;
  if (shift.way_m <= kSmall * certified_size_m(pairs, judge)) return std::nullopt;
  return StampsOff{shift.shift_s, offset_s - shift.shift_s, judge.has_value()};
}

}  // namespace

bool Doubts::ours_seldom() const {
  return ours_every_s > kSeldom * certified_every_s;
}

TimeShift shift_to_truth(const std::vector<Pair>& pairs, const Judge& judge) {
  std::vector<Lag> lags;
  for (const auto& pair : pairs) {
    const auto& report = pair.certified;
    lags.push_back({pair.leg, std::abs(report.speed_mps), -report.running * judge.error_m(report)});
  }
  return time_shift(lags);
}

Doubts doubts_of(const Pairing& pairing, const std::optional<Judge>& judge, double offset_s) {
  std::set<size_t> apart;
  std::map<size_t, int> turned;  // pairs of the leg that are, less those that are not
  std::map<size_t, int> runs_apart;
  for (const auto& pair : pairing.pairs) {
    if (!pair.overlap() && !(judge && judge->covers(pair))) apart.insert(pair.leg);
    turned[pair.leg] += pair.turned() ? 1 : -1;
    runs_apart[pair.leg] += pair.runs_apart() ? 1 : -1;
  }
  // Where the driver changes the cab or the train sets back the two may say so one report apart.
  const auto most_are = [](const std::map<size_t, int>& legs) {
    return static_cast<size_t>(std::ranges::count_if(legs, [](const auto& leg) { return leg.second >= 0; }));
  };
  return {apart.size(),         most_are(turned),
          most_are(runs_apart), stamps_off(without_repeats(pairing.pairs), judge, offset_s),
          pairing.ours.every_s, pairing.certified.every_s};
}

}  // namespace railfix::compare
