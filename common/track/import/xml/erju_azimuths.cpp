#include "track/import/xml/erju_azimuths.hpp"

#include <algorithm>
#include <cmath>

#include "core/units.hpp"
#include "track/import/told.hpp"

namespace railfix::track {
namespace {

constexpr double kNearStationM = 0.1;
constexpr double kSharpestRadiusM = 10.0;
constexpr double kMeetsRad = 1e-3;
constexpr double kAboutM = 10.0;  // on either side: azimuths stand that near in the files at hand, and scatter

using Crooked = std::vector<std::pair<double, double>>;  // offset, turn

double turn_of(const ErjuAzimuth& from, const ErjuAzimuth& to) {
  return core::wrap_pi(to.heading_rad - from.heading_rad);
}

bool is_crooked(const ErjuAzimuth& from, const ErjuAzimuth& to) {
  return std::abs(turn_of(from, to)) * kSharpestRadiusM > to.offset_m - from.offset_m;
}

void tell_crooked(const Crooked& crooked, const NetTrack& track, std::vector<std::string>& problems) {
  if (crooked.empty()) return;
  const auto sharpest = std::ranges::max_element(crooked, {}, [](const auto& one) { return one.second; });
  problems.push_back("track edge \"" + track.track.name + "\" turns at once by up to " + told_deg(sharpest->second) +
                     " at " + std::to_string(crooked.size()) + " of its azimuths, the first at " +
                     told_m(crooked.front().first) + "; left out, as a track that was measured to and fro");
}

/// Behind the last azimuth.
void add_last_bend(const ErjuAzimuth& last, NetTrack& track, std::vector<std::string>& problems) {
  if (track.length_m - last.offset_m < kNearStationM) return;
  if (last.arc_curvature_per_m) {
    track.bends.push_back({last.offset_m, track.length_m, *last.arc_curvature_per_m, *last.arc_curvature_per_m});
  } else if (last.is_curved) {
    problems.push_back("track edge \"" + track.track.name + "\" has a curve at " + told_m(last.offset_m) +
                       " that no azimuth ends, and no arc's radius; it is taken as a straight");
  }
}

}  // namespace

std::vector<ErjuAzimuth> azimuths_of(const XmlSource& infra, const pugi::xml_node& geometry) {
  std::vector<ErjuAzimuth> out;
  for (const char* kind : {"horizontalSegmentLine", "horizontalSegmentArc", "horizontalSegmentTransition"}) {
    for (const pugi::xml_node& item : descendants(geometry, kind)) {
      ErjuAzimuth at{metres(infra.required(item, "trackGeometryPos")),
                     core::rad_from_deg(infra.required(item, "azimuth"))};
      at.is_curved = kind != std::string("horizontalSegmentLine");
      const double radius_m = metres(infra.number(item, "radius").value_or(0));
      if (kind == std::string("horizontalSegmentArc") && std::abs(radius_m) >= kSharpestRadiusM)
        at.arc_curvature_per_m = 1 / radius_m;
      out.push_back(at);
    }
  }
  std::ranges::stable_sort(out, {}, &ErjuAzimuth::offset_m);
  return out;
}

double curvature_about(const std::vector<ErjuAzimuth>& azimuths, double offset_m) {
  const auto after = std::ranges::lower_bound(azimuths, offset_m + kAboutM, {}, &ErjuAzimuth::offset_m);
  const auto behind = std::ranges::upper_bound(azimuths, offset_m - kAboutM, {}, &ErjuAzimuth::offset_m);
  if (after == azimuths.end()) {
    const bool on_last_arc = !azimuths.empty() && azimuths.back().offset_m <= offset_m;
    return on_last_arc ? azimuths.back().arc_curvature_per_m.value_or(0) : 0;
  }
  if (behind == azimuths.begin()) return 0;
  const ErjuAzimuth& before = *(behind - 1);
  return is_crooked(before, *after) ? 0 : -turn_of(before, *after) / (after->offset_m - before.offset_m);
}

std::vector<Element> plan_of(const std::vector<ErjuAzimuth>& azimuths, double length_m) {
  if (azimuths.empty() || azimuths.front().offset_m > kNearStationM) return {};
  std::vector<Element> out;
  double reached_m = 0;
  double turned_rad = 0;
  for (size_t i = 0; i < azimuths.size(); ++i) {
    const ErjuAzimuth& from = azimuths[i];
    const bool turns_here = std::abs(core::wrap_pi(turn_of(azimuths.front(), from) - turned_rad)) > kMeetsRad;
    if (turns_here || (from.is_curved && !from.arc_curvature_per_m)) return {};
    const bool is_last = i + 1 == azimuths.size();
    const double to_m = is_last ? length_m : std::min(azimuths[i + 1].offset_m, length_m);
    const double curvature_per_m = from.arc_curvature_per_m.value_or(0);
    turned_rad -= curvature_per_m * (to_m - from.offset_m);
    if (to_m - reached_m < kNearStationM && !is_last) continue;
    if (to_m <= reached_m) continue;
    const bool goes_on = !out.empty() && out.back().curvature_end_per_m == curvature_per_m;
    if (!goes_on) out.push_back({0, curvature_per_m, curvature_per_m});
    out.back().length_m += to_m - reached_m;
    reached_m = to_m;
  }
  return out;
}

void add_bends(const std::vector<ErjuAzimuth>& azimuths, NetTrack& track, std::vector<std::string>& problems) {
  if (azimuths.empty()) return;
  Crooked crooked;
  const auto leave_out = [&](const ErjuAzimuth& one, double turn) {
    crooked.emplace_back(one.offset_m, std::abs(turn));
  };
  size_t before = 0;
  if (azimuths.size() > 2 && is_crooked(azimuths[0], azimuths[1]) && is_crooked(azimuths[0], azimuths[2]) &&
      !is_crooked(azimuths[1], azimuths[2])) {
    leave_out(azimuths[0], turn_of(azimuths[0], azimuths[1]));
    before = 1;  // it is the first one that is wrong
  }
  for (size_t i = before + 1; i < azimuths.size(); ++i) {
    const double length = azimuths[i].offset_m - azimuths[before].offset_m;
    if (length < kNearStationM) continue;
    const double turn = turn_of(azimuths[before], azimuths[i]);
    if (is_crooked(azimuths[before], azimuths[i])) {
      leave_out(azimuths[i], turn);
      continue;
    }
    track.bends.push_back({azimuths[before].offset_m, azimuths[i].offset_m, -turn / length, -turn / length});
    before = i;
  }
  tell_crooked(crooked, track, problems);
  add_last_bend(azimuths[before], track, problems);
}

}  // namespace railfix::track
