#include "map/coverage.hpp"

#include <algorithm>
#include <cmath>
#include <optional>
#include <set>
#include <utility>

namespace railfix::tool {
namespace {

// In runs with pictures odometers and landmarks are off by something, and rivals a little elsewhere
// (docs/figures/map.md).
constexpr double kOfRealRuns = 1.07;
constexpr double kWidestRowM = 1000;
constexpr double kNarrowestRowM = 60;
constexpr double kSightedFromM = 20;  // a train that begins there has passed what is nearer
constexpr double kMarkerBesideM = 3;  // on either side
constexpr double kLeastWayM = 1;

/// Where a way runs over a track for the second time, as on a ring; nothing where it does not.
std::optional<double> until_it_comes_again(const track::Path& path) {
  const track::Route route = path.route();
  std::set<std::pair<uint32_t, bool>> run;
  for (const track::Route::Leg& leg : route.legs()) {
    if (run.emplace(leg.run.edge->id, leg.run.forward).second) continue;
    const bool is_first = leg.run == route.legs().front().run;  // the start lies on it
    return is_first ? leg.begin_m - route.begin_m() : leg.begin_m;
  }
  return std::nullopt;
}

/// Distances of a path as the train meets them, from 0 on; and back.
class Running {
 public:
  Running(const track::Path& path, bool backwards) : path_(path), backwards_(backwards) {}

  [[nodiscard]] double run_m(double path_m) const {
    return backwards_ ? path_.end_m() - path_m : path_m - path_.begin_m();
  }
  [[nodiscard]] double path_m(double run_m) const {
    return backwards_ ? path_.end_m() - run_m : path_.begin_m() + run_m;
  }
  [[nodiscard]] double length_m() const { return path_.end_m() - path_.begin_m(); }

  [[nodiscard]] RideWay way(const CoverageOptions& options) const {
    RideWay way{.length_m = length_m()};
    const double sign = backwards_ ? -1 : 1;
    double elevation_m = 0;
    const int samples = static_cast<int>(way.length_m / RideWay::kSampledEveryM) + 3;
    for (int i = 0; i < samples; ++i) {
      const double at_m = RideWay::kSampledEveryM * i;
      way.curvature_per_m.push_back(sign * path_.curvature_at(path_m(at_m)));
      const double middle_m = path_m(at_m + 0.5 * RideWay::kSampledEveryM);
      way.profile.push_back({at_m, elevation_m, 0, !path_.grade_known_at(middle_m)});
      const double grade = sign * path_.at(middle_m).grade;
      elevation_m += grade * RideWay::kSampledEveryM;
    }
    for (const track::PathLandmark& mark : path_.landmarks()) {
      if (!counts(mark.kind, options)) continue;
      track::Landmark seen = *mark.landmark;
      seen.kind = track::seen_along(mark.kind, !backwards_);
      seen.offset_m = run_m(mark.distance_m);
      seen.lateral_m = sign * mark.lateral_m;
      way.landmarks.push_back(std::move(seen));
    }
    if (backwards_) std::ranges::reverse(way.landmarks);
    return way;
  }

 private:
  const track::Path& path_;
  bool backwards_;
};

std::vector<PromisedPlace> promised_on(const RideWay& way, const CoverageOptions& options) {
  std::vector<PromisedPlace> promised = nominal_ride(way, options.fusion, options.speed_mps);
  for (PromisedPlace& place : promised) place.half_m *= kOfRealRuns;
  return promised;
}

Extent extent_of(const RideWay& way, const CoverageOptions& options) {
  Extent out{.covered_m = way.length_m};
  double before_m = 0;
  bool is_open = false;
  for (const PromisedPlace& place : promised_on(way, options)) {
    out.largest_m = std::max(out.largest_m, place.half_m);
    const bool was_open = std::exchange(is_open, place.half_m > options.limit_m);
    if (is_open) {
      if (!was_open) out.gaps.push_back({.from_m = before_m});
      CoverageGap& gap = out.gaps.back();
      gap.to_m = place.at_m;
      gap.largest_m = std::max(gap.largest_m, place.half_m);
      gap.outside_budget = gap.outside_budget || place.outside_budget;
      out.covered_m -= place.at_m - before_m;
    }
    before_m = place.at_m;
  }
  if (is_open) {  // less than a picture is left
    out.gaps.back().to_m = way.length_m;
    out.covered_m -= way.length_m - before_m;
  }
  // A train that still stands where it begins has run nothing.
  std::erase_if(out.gaps, [](const CoverageGap& gap) { return gap.to_m <= gap.from_m; });
  return out;
}

/// A train on the path, or back on it, and what of it is proposed so far.
struct Ride {
  Ride(const track::Path& path, const CoverageOptions& options, bool backwards)
      : running(path, backwards), way(running.way(options)), extent(extent_of(way, options)) {}

  void put_marker(double path_m, double sigma_m) {
    const track::Landmark marker{.kind = track::LandmarkKind::mast,
                                 .offset_m = running.run_m(path_m),
                                 .lateral_m = kMarkerBesideM,
                                 .sigma_m = sigma_m,
                                 .name = {}};
    const auto by_place = [](const track::Landmark& a, const track::Landmark& b) { return a.offset_m < b.offset_m; };
    way.landmarks.insert(std::ranges::upper_bound(way.landmarks, marker, by_place), marker);
  }

  Running running;
  RideWay way;
  Extent extent;
};

/// Places on the path. Fusion believes none of the last two: the third of a row lies where the interval would be too
/// long.
std::vector<double> row_for(const Ride& ride, double every_m) {
  std::vector<double> row_m;
  for (const CoverageGap& gap : ride.extent.gaps) {
    const int places = 2 + static_cast<int>(std::ceil((gap.to_m - gap.from_m) / every_m));
    for (int i = 0; i < places; ++i) {
      const double at_m = gap.from_m + (i - 2) * every_m;
      const auto is_near = [&](double other_m) { return std::abs(other_m - at_m) < 0.5 * every_m; };
      if (at_m < kSightedFromM || std::ranges::any_of(ride.way.landmarks, is_near, &track::Landmark::offset_m) ||
          std::ranges::any_of(row_m, is_near))
        continue;
      row_m.push_back(at_m);
    }
  }
  for (double& at_m : row_m) at_m = ride.running.path_m(at_m);
  return row_m;
}

/// Rows are made closer only where the wider ones do not help; what one direction has serves the other.
std::vector<double> propose_markers(Ride& there, Ride& back, const CoverageOptions& options) {
  std::vector<double> markers_m;
  for (double every_m = kWidestRowM; every_m > kNarrowestRowM; every_m /= 2) {
    for (Ride* needy : {&there, &back}) {
      const std::vector<double> row_m = row_for(*needy, every_m);
      if (row_m.empty()) continue;
      markers_m.insert(markers_m.end(), row_m.begin(), row_m.end());
      for (Ride* ride : {&there, &back}) {
        for (const double at_m : row_m) ride->put_marker(at_m, options.marker_sigma_m);
        ride->extent = extent_of(ride->way, options);
      }
    }
  }
  std::ranges::sort(markers_m);
  return markers_m;
}

Extent on_path(const Ride& ride) {
  Extent out = ride.extent;
  for (CoverageGap& gap : out.gaps) {
    gap.from_m = ride.running.path_m(gap.from_m);
    gap.to_m = ride.running.path_m(gap.to_m);
  }
  return out;
}

}  // namespace

bool counts(track::LandmarkKind kind, const CoverageOptions& options) {
  const auto& kinds = options.sighted;
  return track::can_be_sighted(kind) && (kinds.empty() || std::ranges::find(kinds, kind) != kinds.end());
}

core::Result<track::Path> way_from(std::shared_ptr<const track::Map> map, const track::EdgePosition& start,
                                   double length_m) {
  if (!(length_m > 0)) return core::Error{"--length must be more than 0 m"};
  const auto path = track::Path::follow(map, start, length_m, 0);
  if (!path.ok()) return path;
  if (path.value().end_m() - path.value().begin_m() < std::min(length_m, kLeastWayM))
    return core::Error{
        "the track ends where the way begins; begin elsewhere, or run the other way (EDGE:OFFSET:+ or :-)"};
  const auto lap_m = until_it_comes_again(path.value());
  return lap_m ? track::Path::follow(std::move(map), start, std::min(*lap_m, length_m), 0) : path;
}

References references_on(const track::Path& path, const CoverageOptions& options) {
  References out;
  for (const track::PathLandmark& mark : path.landmarks()) {
    if (counts(mark.kind, options)) ++out.counted[mark.kind];
  }
  const bool balises_count = counts(track::LandmarkKind::balise, options);
  for (const track::PathBaliseGroup& group : path.balise_groups()) {
    const bool on_map = std::ranges::any_of(group.group->balises, [](uint32_t id) { return id != 0; });
    if (group.group->is_virtual) {
      ++out.virtual_groups;
    } else if (!balises_count || !on_map) {
      ++out.unsighted_groups;
    }
  }
  return out;
}

std::vector<PromisedPlace> promised_on(const track::Path& path, const CoverageOptions& options, bool backwards) {
  return promised_on(Running(path, backwards).way(options), options);
}

Coverage coverage_of(const track::Path& path, const CoverageOptions& options) {
  Ride there(path, options, false);
  Ride back(path, options, true);
  const BothWays now{on_path(there), on_path(back)};
  Coverage out{.now = now, .markers_m = propose_markers(there, back, options), .with_markers = {}};
  out.with_markers = {on_path(there), on_path(back)};
  const auto covered_m = [](const BothWays& ways) { return ways.there.covered_m + ways.back.covered_m; };
  if (covered_m(out.with_markers) > covered_m(out.now)) return out;
  return {.now = now, .markers_m = {}, .with_markers = now};
}

}  // namespace railfix::tool
