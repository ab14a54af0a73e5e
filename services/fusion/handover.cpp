#include "fusion/handover.hpp"

#include <algorithm>
#include <cmath>

#include "core/time.hpp"
#include "track/path.hpp"
#include "track/same_map.hpp"

namespace railfix::fusion {
namespace {

constexpr double kAccelerationMps2 = 3.0;  // a train neither speeds up nor brakes harder
constexpr double kSpeedErrorShare = 0.02;
constexpr double kSpeedErrorMps = 0.2;

}  // namespace

std::optional<FixInput> place_at(const std::shared_ptr<const track::Map>& map, const KnownPlace& known,
                                 int64_t stamp_ns, double interval_factor) {
  const double age_s = core::seconds(stamp_ns - known.stamp_ns);
  if (std::abs(age_s) > kOldestPlaceS || !std::isfinite(known.speed_mps)) return std::nullopt;
  if (known.track_probability < kBeginProbability) return std::nullopt;
  if (!track::lies_there(*map, known.position, known.pose)) return std::nullopt;
  const double moved_m = known.speed_mps * age_s;
  const double error_m = std::max(known.over_m, known.under_m) + kAccelerationMps2 / 2 * age_s * age_s +
                         (kSpeedErrorShare * std::abs(known.speed_mps) + kSpeedErrorMps) * std::abs(age_s);
  if (!std::isfinite(error_m)) return std::nullopt;
  const double reach_m = std::abs(moved_m) + error_m;
  const auto path = track::Path::follow(map, known.position, reach_m, reach_m);
  if (!path.ok()) return std::nullopt;
  const double low_m = std::min(0.0, moved_m - error_m);
  const double high_m = std::max(0.0, moved_m + error_m);
  const auto& switches = path.value().switches();
  // On the way since then only; the ones before it are in the probability.
  const bool divided = age_s != 0 && std::any_of(switches.begin(), switches.end(), [&](const track::PathSwitch& one) {
                         return one.ahead ? one.distance_m > 0 && one.distance_m <= high_m
                                          : one.distance_m < 0 && one.distance_m >= low_m;
                       });
  if (divided) return std::nullopt;
  const auto place = path.value().position_at(moved_m);
  FixInput fix;
  fix.stamp_ns = stamp_ns;
  fix.edge = place.edge;
  fix.offset_m = place.offset_m;
  fix.direction = place.direction;
  fix.sigma_m = error_m / interval_factor;
  fix.probability = known.track_probability;
  fix.kind = FixKind::network;
  fix.only_told = known.only_told;
  fix.of_before = true;
  fix.in_doubt = known.in_doubt;
  return fix;
}

}  // namespace railfix::fusion
