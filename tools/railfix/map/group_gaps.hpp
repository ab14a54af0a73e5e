// Where on a way reports would refer to a balise group that lies far behind, and where virtual groups are missing.
#pragma once

#include <vector>

#include "map/coverage.hpp"

namespace railfix::tool {

struct GroupGap {
  double from_m = 0;  // distances on the path: a group, or where the path begins
  double to_m = 0;    // the next one, or where it ends
  std::vector<double> missing_m{};
};

/// Stretches without a group, real or virtual, that are longer than `group_limit_m`. The groups that are proposed leave
/// none: evenly, or beside a landmark that the camera sights, by which the train knows where it passes them, if there
/// is one in the further half of what is allowed.
std::vector<GroupGap> group_gaps(const track::Path& path, const CoverageOptions& options);

}  // namespace railfix::tool
