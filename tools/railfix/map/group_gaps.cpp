#include "map/group_gaps.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

namespace railfix::tool {
namespace {

constexpr double kRoundedM = 0.2;     // as both ends of a stretch may be told
constexpr double kNearGroupM = 20.0;  // where `map build` puts none

/// The next one behind `at_m`: as few as can be, evenly up to the end, or at the last landmark that makes it no more.
double next_group_m(const track::Path& path, const CoverageOptions& options, double at_m, double to_m) {
  const double limit_m = options.group_limit_m - kRoundedM;
  const double count = std::ceil((to_m - at_m) / limit_m);  // of stretches
  double found_m = at_m + (to_m - at_m) / count;
  const double first_m = std::max(at_m + 0.5 * limit_m, to_m - (count - 1) * limit_m);
  for (const track::PathLandmark& mark :
       path.landmarks_between(first_m, std::min(at_m + limit_m, to_m - kNearGroupM))) {
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
      at_m = next_group_m(path, options, at_m, gap.to_m);
      gap.missing_m.push_back(at_m);
    }
    if (!gap.missing_m.empty()) out.push_back(std::move(gap));
  }
  return out;
}

}  // namespace railfix::tool
