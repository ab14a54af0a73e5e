#include "fusion/other_ways.hpp"

#include <algorithm>
#include <cmath>

namespace railfix::fusion {
namespace {

constexpr double kCorrectedM = 5.0;
constexpr double kAsFarM = 3.0;

}  // namespace

// Who says it follows the place that fusion has told: what it is off by is a correction of a moment ago, or more than
// that, and then nobody knows who is right. Ways that were named once stay: who does not name them any more may have
// been started anew.
void OtherWays::said(const Sides& otherwise, double off_m) {
  const double more_m = std::abs(off_m) > kCorrectedM ? off_m : 0;
  const Sides said{std::max(0.0, otherwise.behind_m - more_m), std::max(0.0, otherwise.ahead_m + more_m)};
  const bool named = otherwise.behind_m > 0 || otherwise.ahead_m > 0;
  if (named) named_.hold(said);
  said_elsewhere_ = named ? Sides{} : said;
}

Sides OtherWays::named() const {
  Sides ways = joined_;
  ways.hold(named_);
  return ways;
}

Sides OtherWays::held() const {
  Sides ways = named();
  ways.hold(said_elsewhere_);
  return ways;
}

bool OtherWays::told_apart_by(const FixInput& fix, const track::Path& path, double here_m) const {
  const Sides ways = held();
  if (fix.kind != FixKind::landmark || ways.behind_m + ways.ahead_m == 0) return true;
  const auto place_m = path.distance_of({fix.edge, fix.offset_m, fix.direction}, here_m);
  if (!place_m) return true;
  const auto* seen = path.map().landmark(fix.landmark);
  if (seen == nullptr) return true;
  const auto stands_at = [&](double m) {
    return std::ranges::any_of(path.landmarks_between(m - kAsFarM, m + kAsFarM),
                               [&](const track::PathLandmark& other) { return other.landmark->kind == seen->kind; });
  };
  return !(ways.behind_m > 0 && stands_at(*place_m - ways.behind_m)) &&
         !(ways.ahead_m > 0 && stands_at(*place_m + ways.ahead_m));
}

}  // namespace railfix::fusion
