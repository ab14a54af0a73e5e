#include "track/import/xml/landxml_reach.hpp"

#include <cmath>

namespace railfix::track {
namespace {

constexpr double kNoCantM = 1e-3;
constexpr double kSameArcPerM = 1e-9;

}  // namespace

bool level_to_ends(std::vector<GradePoint>& profile, double length_m) {
  if (profile.empty()) return false;
  const bool begins_late = profile.front().offset_m > kToldOutsideM;
  const bool ends_early = profile.back().offset_m < length_m - kToldOutsideM;
  if (begins_late) {
    profile.front().curve_length_m = 0;
    profile.insert(profile.begin(), {0, profile.front().elevation_m, 0, true});
  }
  if (ends_early) {
    profile.back().curve_length_m = 0;
    profile.back().is_guess = true;
    profile.push_back({length_m, profile.back().elevation_m, 0, true});
  }
  return begins_late || ends_early;
}

bool runs_on(const std::vector<CantPoint>& cant, const std::vector<Element>& elements) {
  if (cant.empty() || std::abs(cant.back().cant_m) < kNoCantM) return false;
  const double arc_per_m = elements.back().curvature_end_per_m;
  double left_m = -cant.back().offset_m;
  for (const Element& element : elements) left_m += element.length_m;
  if (left_m < kToldOutsideM) return false;
  if (arc_per_m == 0) return true;
  for (auto element = elements.rbegin(); element != elements.rend() && left_m > kToldOutsideM; ++element) {
    if (std::abs(element->curvature_start_per_m - arc_per_m) > kSameArcPerM) return true;
    left_m -= element->length_m;
  }
  return false;
}

}  // namespace railfix::track
