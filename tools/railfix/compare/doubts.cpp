#include "compare/doubts.hpp"

#include <algorithm>
#include <cmath>
#include <map>
#include <set>
#include <utility>

#include "evaluation/statistics.hpp"

namespace railfix::compare {

namespace {

constexpr double kSeldom = 1.1;
constexpr double kSigmas = 3;
constexpr double kLeastShiftS = 1e-3;  // rounding alone is no shift
constexpr double kChance = 0.01;       // of all pairs
constexpr double kMostSilent = 0.05;   // of certified reports, as the margin of what is known
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

/// Pairs that contradict each other, by leg.
class Contradicted {
 public:
  explicit Contradicted(size_t pairs) : most_(kChance * static_cast<double>(pairs)) {}
  void add(size_t leg, bool apart) {
    auto& [all, bad] = legs_[leg];
    ++all;
    bad += apart;
    sum_ += apart;
  }
  [[nodiscard]] size_t legs() const {
    const bool often = static_cast<double>(sum_) > most_;
    return static_cast<size_t>(std::ranges::count_if(legs_, [&](const auto& leg) {
      const auto [all, bad] = leg.second;
      return bad > 0 && (often || bad > 1 || 2 * bad >= all);
    }));
  }

 private:
  double most_;
  size_t sum_ = 0;
  std::map<size_t, std::pair<size_t, size_t>> legs_;  // pairs, and those that contradict
};

/// Ours may refer to other tracks between the certified reports only.
size_t legs_off_line(const Counted& ours) {
  Contradicted off_line(ours.placed.size() + ours.off_line.size());
  for (const auto& report : ours.placed) off_line.add(report.leg, false);
  for (const auto& report : ours.off_line) off_line.add(report.leg, report.beside_line);
  return off_line.legs();
}

void look_beside(const std::vector<BesideCertified>& beside, Doubts& doubts) {
  Contradicted off_line(beside.size());
  Contradicted other_groups(beside.size());
  for (const auto& [leg, ours] : beside) {
    off_line.add(leg, ours == Beside::off_line);
    other_groups.add(leg, ours == Beside::other_group);
    doubts.silent += ours == Beside::silent;
    doubts.heard += ours != Beside::unknown;
  }
  doubts.off_line = off_line.legs();
  doubts.other_groups = other_groups.legs();
}

/// Where the driver changes the cab or the train sets back the two may say so one report apart.
bool beside_change(const std::vector<Pair>& pairs, size_t i, double PlacedReport::*way) {
  const auto changes = [&](size_t before, size_t after) {
    const auto& a = pairs[before].certified;
    const auto& b = pairs[after].certified;
    return a.axis == b.axis && a.*way * b.*way < 0;
  };
  return (i > 0 && changes(i - 1, i)) || (i + 1 < pairs.size() && changes(i, i + 1));
}

}  // namespace

bool Doubts::ours_seldom() const {
  return !std::isnan(certified_every_s) && !(ours_every_s <= kSeldom * certified_every_s);
}

bool Doubts::ours_silent() const {
  return static_cast<double>(silent) > kMostSilent * static_cast<double>(heard);
}

bool Doubts::other_times() const {
  return static_cast<double>(outside) > kChance * static_cast<double>(in_all);
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
  const auto& pairs = pairing.pairs;
  std::set<size_t> apart;
  Contradicted turned(pairs.size());
  Contradicted runs_apart(pairs.size());
  Contradicted speeds_apart(pairs.size());
  for (size_t i = 0; i < pairs.size(); ++i) {
    const auto& pair = pairs[i];
    if (!pair.overlap() && !(judge && judge->covers(pair))) apart.insert(pair.leg);
    turned.add(pair.leg, pair.turned() && !beside_change(pairs, i, &PlacedReport::facing));
    runs_apart.add(pair.leg, pair.runs_apart() && !beside_change(pairs, i, &PlacedReport::running));
    speeds_apart.add(pair.leg, pair.speeds_apart());
  }
  Doubts doubts{.apart = apart.size(),
                .turned = turned.legs(),
                .runs_apart = runs_apart.legs(),
                .speeds_apart = speeds_apart.legs(),
                .stamps = stamps_off(without_repeats(pairs), judge, offset_s),
                .outside = pairing.outside_ours,
                .in_all = pairing.availability.size() + pairing.outside_ours,
                .ours_every_s = pairing.ours.every_s,
                .certified_every_s = pairing.certified.every_s};
  look_beside(pairing.beside, doubts);
  doubts.off_line = std::max(doubts.off_line, legs_off_line(pairing.ours));
  return doubts;
}

}  // namespace railfix::compare
