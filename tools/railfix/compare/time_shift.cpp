#include "compare/time_shift.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>

namespace railfix::compare {

TimeShift time_shift(const std::vector<Lag>& lags) {
  std::vector<Lag> known;
  std::ranges::copy_if(lags, std::back_inserter(known),
                       [](const Lag& lag) { return std::isfinite(lag.speed_mps) && std::isfinite(lag.behind_m); });
  const auto n = static_cast<double>(known.size());
  double mean_v = 0;
  double mean_d = 0;
  double square_v = 0;
  for (const auto& lag : known) {
    mean_v += lag.speed_mps / n;
    mean_d += lag.behind_m / n;
    square_v += lag.speed_mps * lag.speed_mps / n;
  }
  double vv = 0;
  double vd = 0;
  for (const auto& lag : known) {
    vv += (lag.speed_mps - mean_v) * (lag.speed_mps - mean_v);
    vd += (lag.speed_mps - mean_v) * (lag.behind_m - mean_d);
  }
  if (known.size() < 3 || vv < 1) {
    const double unknown = std::numeric_limits<double>::quiet_NaN();
    return {unknown, unknown, unknown};
  }
  const double shift_s = vd / vv;
  // The larger of two: as if each report erred alone, and as if each leg did (Liang, Zeger, "Longitudinal data analysis
  // using generalized linear models", Biometrika 73, 1986), which with few legs says too little.
  double rests = 0;
  std::map<size_t, double> scores;
  for (const auto& lag : known) {
    const double rest = lag.behind_m - mean_d - shift_s * (lag.speed_mps - mean_v);
    rests += rest * rest;
    scores[lag.leg] += rest * (lag.speed_mps - mean_v);
  }
  double squares = 0;
  for (const auto& [leg, score] : scores) squares += score * score;
  const auto legs = static_cast<double>(scores.size());
  const double by_leg = legs > 1 ? squares * legs / (legs - 1) / vv / vv : 0;
  return {shift_s, std::sqrt(std::max(rests / (n - 2) / vv, by_leg)), std::abs(shift_s) * std::sqrt(square_v)};
}

TimeShift time_shift(const std::vector<Pair>& pairs) {
  std::vector<Lag> lags;
  lags.reserve(pairs.size());
  for (const auto& pair : pairs) lags.push_back({pair.leg, std::abs(pair.certified.speed_mps), pair.difference_m()});
  return time_shift(lags);
}

}  // namespace railfix::compare
