#include "track/import/tracks.hpp"

#include <algorithm>
#include <cmath>

namespace railfix::track {

void FitFigures::include(const FitFigures& other) {
  elements += other.elements;
  max_end_error_m = std::max(max_end_error_m, other.max_end_error_m);
  max_length_change_m = std::max(max_length_change_m, other.max_length_change_m);
  max_heading_step_rad = std::max(max_heading_step_rad, other.max_heading_step_rad);
  max_gap_m = std::max(max_gap_m, other.max_gap_m);
  max_point_distance_m = std::max(max_point_distance_m, other.max_point_distance_m);
  max_chord_deviation_m = std::max(max_chord_deviation_m, other.max_chord_deviation_m);
}

std::optional<EtcsIdentity> etcs_identity(double nid_c, double nid_bg) {
  const auto is_whole = [](double value, uint32_t last) {
    return value >= 0 && value <= last && value == std::floor(value);
  };
  if (!is_whole(nid_c, BaliseGroup::kLastNidC) || !is_whole(nid_bg, BaliseGroup::kLastNidBg)) return std::nullopt;
  return EtcsIdentity{static_cast<uint32_t>(nid_c), static_cast<uint32_t>(nid_bg)};
}

std::vector<CantPoint> held(std::vector<CantPoint> changes) {
  if (changes.empty()) return {};
  std::ranges::stable_sort(changes, {}, &CantPoint::offset_m);
  std::vector<CantPoint> out{{0, 0}};
  for (const CantPoint& change : changes) {
    if (change.offset_m <= 0) {
      out = {{0, change.cant_m}};
      continue;
    }
    out.push_back({change.offset_m, out.back().cant_m});
    out.push_back(change);
  }
  return out;
}

void add_speeds(std::vector<std::pair<double, double>> changes, Direction running, double length_m,
                ImportedTrack& track) {
  std::stable_sort(changes.begin(), changes.end(), [](const auto& a, const auto& b) { return a.first < b.first; });
  const bool forward = running != Direction::reverse;
  for (size_t i = 0; i < changes.size(); ++i) {
    const auto& [at, speed_mps] = changes[i];
    const double before = i == 0 ? 0.0 : changes[i - 1].first;
    const double after = i + 1 < changes.size() ? changes[i + 1].first : length_m;
    const double from = std::clamp(forward ? at : before, 0.0, length_m);
    const double to = std::clamp(forward ? after : at, 0.0, length_m);
    if (speed_mps > 0 && to > from) track.speed_limits.push_back({from, to, speed_mps, running});
  }
}

}  // namespace railfix::track
