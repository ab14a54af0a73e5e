#include "track_detector/platform_tracker.hpp"

#include <algorithm>
#include <cmath>

namespace railfix::track_detector {
namespace {

constexpr double kFollowM = 0.6;
constexpr double kSidewaysM = 0.15;
constexpr int kMostMissed = 4;
constexpr int kFewestPictures = 5;
constexpr double kSeenShare = 0.6;
constexpr double kShortestWayM = 9;      // on which it is followed
constexpr double kLongestGapM = 8.3;     // it is followed to here at least
constexpr double kUsualLateralM = 1.68;  // of platform edges
constexpr double kLateralSigmaM = 0.05;
constexpr double kFactors[] = {0.90, 1.20};  // heights 0.3 to 0.9 m
constexpr double kFactorsAgree = 0.08;
constexpr double kSamePlatformM = 3;
constexpr double kSpotSigmaM = 0.06;
constexpr double kSpotPerM = 0.0012;  // times the distance squared
constexpr double kWorstFit = 3.0;     // of the spot sigma
constexpr double kEndSigmaM = 0.12;   // how an end looks differs

double spot_sigma(double ahead_m) {
  return kSpotSigmaM + kSpotPerM * ahead_m * ahead_m;
}

constexpr size_t kUsuallyFollowed = 64;

}  // namespace

PlatformTracker::PlatformTracker() {
  marks_.reserve(kUsuallyFollowed);
  settled_.reserve(kUsuallyFollowed);
}

const std::vector<SettledPlatform>& PlatformTracker::follow(const std::vector<PlatformMark>& found, double way_m) {
  settled_.clear();
  for (Mark& mark : marks_) mark.hit = false;
  for (const PlatformMark& candidate : found) {
    Mark* owner = nullptr;
    double nearest_m = kFollowM;
    for (Mark& mark : marks_) {
      if (mark.hit || mark.side != candidate.side || mark.begins != candidate.begins) continue;
      if (std::abs(mark.beside_m - candidate.beside_m) > kSidewaysM) continue;
      const double off_m = std::abs(mark.last_ahead_m - (way_m - mark.last_way_m) - candidate.ahead_m);
      if (off_m < nearest_m) {
        nearest_m = off_m;
        owner = &mark;
      }
    }
    if (owner == nullptr) {
      marks_.emplace_back();
      owner = &marks_.back();
      owner->side = candidate.side;
      owner->begins = candidate.begins;
      owner->first_way_m = way_m;
    }
    add(*owner, candidate, way_m);
  }
  for (Mark& mark : marks_) {
    if (mark.hit) continue;
    ++mark.missed;
    if (mark.missed <= kMostMissed) continue;
    const auto settled = settle(mark);
    double& last_m = last_m_[mark.side > 0 ? 1 : 0];
    if (!settled || std::abs(settled->place_m - last_m) < kSamePlatformM) continue;
    last_m = settled->place_m;
    settled_.push_back(*settled);
  }
  std::erase_if(marks_, [](const Mark& mark) { return mark.missed > kMostMissed; });
  return settled_;
}

void PlatformTracker::add(Mark& mark, const PlatformMark& found, double way_m) {
  const double sigma_m = spot_sigma(found.ahead_m);
  const double weight = 1 / (sigma_m * sigma_m);
  const double x = way_m - mark.first_way_m;
  mark.w += weight;
  mark.wx += weight * x;
  mark.wy += weight * found.ahead_m;
  mark.wxx += weight * x * x;
  mark.wxy += weight * x * found.ahead_m;
  mark.wyy += weight * found.ahead_m * found.ahead_m;
  mark.beside += weight * found.beside_m;
  mark.last_way_m = way_m;
  mark.last_ahead_m = found.ahead_m;
  mark.beside_m = found.beside_m;
  mark.hit = true;
  mark.gaps += mark.missed;
  mark.missed = 0;
  ++mark.seen;
}

// ahead = factor * (place - way), with the factor known from where it lies beside the track, too.
std::optional<SettledPlatform> PlatformTracker::settle(const Mark& mark) {
  if (mark.seen < kFewestPictures || mark.seen < kSeenShare * (mark.seen + mark.gaps)) return std::nullopt;
  if (mark.last_ahead_m > kLongestGapM || mark.last_way_m - mark.first_way_m < kShortestWayM) return std::nullopt;
  const double mx = mark.wx / mark.w;
  const double my = mark.wy / mark.w;
  const double sxx = mark.wxx - mark.w * mx * mx;
  const double sxy = mark.wxy - mark.w * mx * my;
  const double syy = mark.wyy - mark.w * my * my;
  const double beside_m = mark.beside / mark.w;
  const double by_motion = sxx > 0 ? -sxy / sxx : 0;
  const double motion_sigma = 2.0 / std::sqrt(std::max(sxx, 1e-6));
  const double by_side = beside_m / kUsualLateralM;
  const double side_sigma = kLateralSigmaM / kUsualLateralM * by_side;
  if (by_motion < kFactors[0] || by_motion > kFactors[1]) return std::nullopt;
  if (by_side < kFactors[0] || by_side > kFactors[1]) return std::nullopt;
  if (std::abs(by_motion - by_side) > kFactorsAgree) return std::nullopt;
  const double wm = 1 / (motion_sigma * motion_sigma);
  const double ws = 1 / (side_sigma * side_sigma);
  const double factor = (wm * by_motion + ws * by_side) / (wm + ws);
  const double squared = (syy + 2 * factor * sxy + factor * factor * sxx) / mark.seen;
  if (squared > kWorstFit * kWorstFit) return std::nullopt;
  const double ahead_m = my / factor;
  const double factor_sigma = 1 / std::sqrt(wm + ws);
  const double sigma_m =
      std::hypot(ahead_m * factor_sigma / factor, std::sqrt(std::max(1.0, squared) / mark.w), kEndSigmaM);
  return SettledPlatform{mark.first_way_m + mx + ahead_m, mark.side * beside_m / factor, sigma_m, mark.seen};
}

}  // namespace railfix::track_detector
