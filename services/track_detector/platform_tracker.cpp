#include "track_detector/platform_tracker.hpp"

#include <algorithm>
#include <cmath>

namespace railfix::track_detector {
namespace {

constexpr double kFollowM = 0.6;
constexpr double kSidewaysM = 0.07;
constexpr int kMostMissed = 4;
constexpr size_t kFewestPictures = 10;
constexpr double kPairM = 3;       // way between two looks that tell the factor
constexpr double kCorrelated = 1;  // so many neighbouring looks err together
constexpr double kKeptShare = 0.5;
constexpr double kSeenShare = 0.6;
constexpr double kShortestWayM = 6;          // on which it is followed
constexpr double kLongestGapM = 11;          // it is followed to here at least
constexpr double kUsualLateralM = 1.68;      // of platform edges
constexpr double kLateralSigmaM = 0.15;      // lines are painted behind them
constexpr double kFactors[] = {0.90, 1.20};  // heights 0.3 to 0.9 m
constexpr double kFactorsAgree = 0.12;
constexpr double kWorstSigmaM = 0.30;
constexpr double kSamePlatformM = 3;
constexpr double kHoldM = 3;
constexpr double kWorseSigma = 1.6;
constexpr double kSpotSigmaM = 0.06;
constexpr double kSpotPerM = 0.0012;  // times the distance squared
constexpr double kEndSigmaM = 0.08;   // how an end looks differs

bool between(double value, const double (&range)[2]) {
  return value >= range[0] && value <= range[1];
}

double spot_sigma(double ahead_m) {
  return kSpotSigmaM + kSpotPerM * ahead_m * ahead_m;
}

constexpr size_t kUsuallyFollowed = 64;

}  // namespace

PlatformTracker::PlatformTracker() {
  marks_.reserve(kUsuallyFollowed);
  settled_.reserve(kUsuallyFollowed);
  held_.reserve(kUsuallyFollowed);
  slopes_.reserve(kMostMarks * kMostMarks / 2);
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
    if (const auto settled = settle(mark)) hold(*settled, mark, way_m);
  }
  release(way_m);
  std::erase_if(marks_, [](const Mark& mark) { return mark.missed > kMostMissed; });
  return settled_;
}

// The edge and the lines along it end at the same place: the one that is measured best counts.
void PlatformTracker::hold(const SettledPlatform& settled, const Mark& mark, double way_m) {
  if (std::abs(settled.place_m - last_m_[mark.side > 0 ? 1 : 0]) < kSamePlatformM) return;
  for (Held& held : held_) {
    if (held.side != mark.side || std::abs(held.settled.place_m - settled.place_m) > kSamePlatformM) continue;
    // The land behind an end looks like more edge.
    const bool tighter = mark.begins ? settled.sigma_m < held.settled.sigma_m : settled.place_m < held.settled.place_m;
    if (tighter && settled.sigma_m < kWorseSigma * held.settled.sigma_m) held.settled = settled;
    return;
  }
  held_.push_back({settled, mark.side, way_m});
}

void PlatformTracker::release(double way_m) {
  for (const Held& held : held_) {
    if (way_m - held.way_m < kHoldM) continue;
    last_m_[held.side > 0 ? 1 : 0] = held.settled.place_m;
    settled_.push_back(held.settled);
  }
  std::erase_if(held_, [way_m](const Held& held) { return way_m - held.way_m >= kHoldM; });
}

void PlatformTracker::add(Mark& mark, const PlatformMark& found, double way_m) {
  if (mark.count == kMostMarks) {
    for (size_t i = 0; 2 * i < kMostMarks; ++i) mark.measured[i] = mark.measured[2 * i + 1];
    mark.count = kMostMarks / 2;
  }
  mark.measured[mark.count++] = {way_m - mark.first_way_m, found.ahead_m, found.beside_m};
  mark.last_way_m = way_m;
  mark.last_ahead_m = found.ahead_m;
  mark.beside_m = found.beside_m;
  mark.hit = true;
  mark.gaps += mark.missed;
  mark.missed = 0;
  ++mark.seen;
}

// Median over pairs of looks, which a few wrong ones do not move; 0 = too few.
double PlatformTracker::usual_factor(const Mark& mark) {
  slopes_.clear();
  for (size_t i = 0; i < mark.count; ++i) {
    for (size_t k = i + 1; k < mark.count; ++k) {
      const double way_m = mark.measured[k].way_m - mark.measured[i].way_m;
      if (way_m > kPairM) slopes_.push_back((mark.measured[i].ahead_m - mark.measured[k].ahead_m) / way_m);
    }
  }
  if (slopes_.size() < kFewestPictures) return 0;
  std::nth_element(slopes_.begin(), slopes_.begin() + slopes_.size() / 2, slopes_.end());
  return slopes_[slopes_.size() / 2];
}

// ahead = factor * (place - way), with the factor known from where it lies beside the track, too. Cauchy weights.
std::optional<SettledPlatform> PlatformTracker::settle(const Mark& mark) {
  if (mark.seen < static_cast<int>(kFewestPictures) || mark.seen < kSeenShare * (mark.seen + mark.gaps))
    return std::nullopt;
  if (mark.last_ahead_m > kLongestGapM || mark.last_way_m - mark.first_way_m < kShortestWayM) return std::nullopt;
  double factor = usual_factor(mark);
  if (!between(factor, kFactors)) return std::nullopt;
  slopes_.clear();
  for (size_t i = 0; i < mark.count; ++i) slopes_.push_back(mark.measured[i].way_m + mark.measured[i].ahead_m / factor);
  std::nth_element(slopes_.begin(), slopes_.begin() + slopes_.size() / 2, slopes_.end());
  double place_m = slopes_[slopes_.size() / 2];
  double factor_variance = 0;
  double place_variance = 0;
  double beside_m = 0;
  double kept = 0;
  double scatter = 1;  // of the marks, in their sigmas
  for (int pass = 0; pass < 6; ++pass) {
    double w = 0, wx = 0, wy = 0, wxx = 0, wxy = 0, wb = 0;
    double squared = 0;
    kept = 0;
    for (size_t i = 0; i < mark.count; ++i) {
      const Measurement& m = mark.measured[i];
      const double sigma_m = spot_sigma(m.ahead_m);
      const double off = (m.ahead_m - factor * (place_m - m.way_m)) / (2 * sigma_m);
      const double trust = 1 / (1 + off * off);
      const double weight = trust / (sigma_m * sigma_m);
      kept += trust;
      squared += trust * 4 * off * off;
      w += weight;
      wx += weight * m.way_m;
      wy += weight * m.ahead_m;
      wxx += weight * m.way_m * m.way_m;
      wxy += weight * m.way_m * m.ahead_m;
      wb += weight * m.beside_m;
    }
    scatter = std::max(0.5, squared / kept);
    const double mx = wx / w;
    const double my = wy / w;
    beside_m = wb / w;
    const double by_side = beside_m / kUsualLateralM;
    const double side_weight = std::pow(kUsualLateralM / (kLateralSigmaM * by_side), 2);
    const double motion_weight = (wxx - w * mx * mx) / kCorrelated;
    factor = (side_weight * by_side - (wxy - w * mx * my) / kCorrelated) / (side_weight + motion_weight);
    place_m = mx + my / factor;
    factor_variance = 1 / (side_weight + motion_weight);
    place_variance = (kCorrelated / w + std::pow(my / factor, 2) * factor_variance) / (factor * factor);
    if (!between(factor, kFactors) || !between(by_side, kFactors) || std::abs(factor - by_side) > kFactorsAgree)
      return std::nullopt;
  }
  if (kept < kKeptShare * static_cast<double>(mark.count)) return std::nullopt;
  const double sigma_m = std::hypot(std::sqrt(scatter * place_variance), kEndSigmaM);
  if (sigma_m > kWorstSigmaM) return std::nullopt;
  return SettledPlatform{mark.first_way_m + place_m, mark.side * beside_m / factor, sigma_m, mark.seen};
}

}  // namespace railfix::track_detector
