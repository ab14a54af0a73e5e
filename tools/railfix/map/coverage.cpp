#include "map/coverage.hpp"

#include <algorithm>
#include <cmath>
#include <set>

namespace railfix::tool {
namespace {

struct Reference {
  double at_m = 0;
  double accuracy_m = 0;
};

std::vector<Reference> references_on(const track::Path& path, const CoverageOptions& options) {
  std::vector<Reference> out;
  for (const track::PathBaliseGroup& group : path.balise_groups())
    out.push_back({group.distance_m, group.group->q_locacc_m});
  for (const track::PathLandmark& mark : path.landmarks()) {
    // Balises come with their groups.
    const bool is_natural = track::can_be_sighted(mark.kind) && mark.kind != track::LandmarkKind::balise;
    if (options.natural && is_natural) out.push_back({mark.distance_m, options.sigmas * mark.landmark->sigma_m});
  }
  std::sort(out.begin(), out.end(), [](const Reference& a, const Reference& b) { return a.at_m < b.at_m; });
  return out;
}

/// How far a train gets behind a reference before the limit.
double reach_m(const CoverageOptions& options, double accuracy_m) {
  return std::max(0.0, (options.limit_m - accuracy_m) / (options.sigmas * options.scale_sigma));
}

/// Gaps that touch are one.
void add_gap(const CoverageGap& gap, std::vector<CoverageGap>& gaps) {
  if (gaps.empty() || gaps.back().to_m < gap.from_m) {
    gaps.push_back(gap);
    return;
  }
  CoverageGap& last = gaps.back();
  last.to_m = gap.to_m;
  last.largest_m = std::max(last.largest_m, gap.largest_m);
  last.outside_budget = last.outside_budget || gap.outside_budget;
}

void propose_references(const CoverageOptions& options, CoverageGap& gap) {
  const double step = reach_m(options, options.virtual_locacc_m);
  // With no reach at all no virtual reference helps.
  for (double at = gap.from_m; step > 1.0 && at < gap.to_m; at += step) gap.references_m.push_back(at);
}

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

}  // namespace

double half_interval_m(const CoverageOptions& options, double locacc_m, double way_m) {
  return locacc_m + options.sigmas * options.scale_sigma * way_m;
}

core::Result<track::Path> way_from(std::shared_ptr<const track::Map> map, const track::EdgePosition& start,
                                   double length_m) {
  if (!(length_m > 0)) return core::Error{"--length must be more than 0 m"};
  const auto path = track::Path::follow(map, start, length_m, 0);
  if (!path.ok()) return path;
  const auto lap_m = until_it_comes_again(path.value());
  return lap_m ? track::Path::follow(std::move(map), start, std::min(*lap_m, length_m), 0) : path;
}

Coverage coverage_of(const track::Path& path, const CoverageOptions& options, bool backwards) {
  Coverage out;
  std::vector<Reference> references = references_on(path, options);
  out.references = references.size();
  if (backwards) {  // along an axis that runs the other way
    std::reverse(references.begin(), references.end());
    for (Reference& reference : references) reference.at_m = -reference.at_m;
  }
  // Nothing is reset at the end, it only ends the last stretch.
  references.push_back({backwards ? -path.begin_m() : path.end_m(), 0});
  Reference last{backwards ? -path.end_m() : path.begin_m(), options.virtual_locacc_m};
  for (const Reference& next : references) {
    const double way = next.at_m - last.at_m;
    const double half = half_interval_m(options, last.accuracy_m, way);
    // A reference that knows less than the train does not help it: the stretch goes on.
    if (next.accuracy_m >= half) continue;
    out.largest_m = std::max(out.largest_m, half);
    const double reach = reach_m(options, last.accuracy_m);
    out.covered_m += std::min(way, reach);
    if (way > reach) add_gap({last.at_m + reach, next.at_m, half, {}, half > 5.0 + 0.05 * way}, out.gaps);
    last = next;
  }
  for (CoverageGap& gap : out.gaps) propose_references(options, gap);
  if (backwards) {
    for (CoverageGap& gap : out.gaps) {
      gap.from_m = -gap.from_m;
      gap.to_m = -gap.to_m;
      for (double& at : gap.references_m) at = -at;
    }
  }
  return out;
}

}  // namespace railfix::tool
