#include "map/group_gaps.hpp"

#include <utility>

namespace railfix::tool {
namespace {

/// The next one behind `at_m`.
double next_group_m(const track::Path& path, const CoverageOptions& options, double at_m) {
  const double furthest_m = at_m + options.group_limit_m;
  double found_m = furthest_m;
  for (const track::PathLandmark& mark : path.landmarks_between(at_m + 0.5 * options.group_limit_m, furthest_m)) {
    if (counts(mark.kind, options)) found_m = mark.distance_m;
  }
  return found_m;
}

}  // namespace

std::vector<GroupGap> group_gaps(const track::Path& path, const CoverageOptions& options) {
  std::vector<double> groups_m{path.begin_m()};
  for (const track::PathBaliseGroup& group : path.balise_groups()) groups_m.push_back(group.distance_m);
  groups_m.push_back(path.end_m());
  std::vector<GroupGap> out;
  for (size_t i = 1; i < groups_m.size(); ++i) {
    GroupGap gap{.from_m = groups_m[i - 1], .to_m = groups_m[i]};
    for (double at_m = gap.from_m; gap.to_m - at_m > options.group_limit_m;) {
      at_m = next_group_m(path, options, at_m);
      gap.missing_m.push_back(at_m);
    }
    if (!gap.missing_m.empty()) out.push_back(std::move(gap));
  }
  return out;
}

}  // namespace railfix::tool
