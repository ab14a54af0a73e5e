#include "tpr_publisher/reference.hpp"

#include <algorithm>
#include <cmath>

#include "track/path.hpp"

namespace railfix::tpr_publisher {

namespace {

constexpr size_t kRemembered = 8;

}  // namespace

std::optional<Reference> Reference::remembered(uint32_t nid_lrbg, std::optional<double> expected_foot_m) const {
  std::optional<Reference> found;
  const auto consider = [&](Reference one) {
    if (one.group->nid_lrbg() != nid_lrbg) return;
    const bool better = !found || (expected_foot_m && std::abs(one.foot_m - *expected_foot_m) <
                                                          std::abs(found->foot_m - *expected_foot_m));
    if (better) found = std::move(one);
  };
  consider(*this);
  for (const auto& one : earlier) {
    consider({one.group, one.previous, one.nominal_along, one.from_previous_along, foot_m + one.ahead_m,
              doubt_m + one.doubt_m, 0, one.passed});
  }
  return found;
}

Reference passed_behind(Reference present, const Reference& last, double within_m) {
  const double ahead_m = last.foot_m - present.foot_m;
  present.earlier = {
      {last.group, last.previous, last.nominal_along, last.from_previous_along, ahead_m, last.doubt_m, last.passed}};
  for (auto other : last.earlier) {
    other.ahead_m += ahead_m;
    other.doubt_m += last.doubt_m;
    present.earlier.push_back(other);
  }
  std::erase_if(present.earlier, [&](const EarlierGroup& one) { return std::abs(one.ahead_m) > within_m; });
  if (present.earlier.size() > kRemembered) present.earlier.resize(kRemembered);
  return present;
}

std::vector<Reference> groups_on_only_way(const std::shared_ptr<const track::Map>& map, const track::EdgePosition& foot,
                                          bool ahead, double within_m) {
  std::vector<Reference> groups;
  const auto path = track::Path::follow(map, foot, ahead ? within_m : 0, ahead ? 0 : within_m);
  if (!path.ok()) return groups;
  // Beyond points that divide the way it is not the only one any more.
  const double sign = ahead ? 1 : -1;
  double most_m = within_m;
  for (const auto& one : path.value().switches()) {
    const double back_m = sign * one.distance_m;
    if (one.ahead == ahead && back_m >= 0) most_m = std::min(most_m, back_m);
  }
  for (const auto& mark : path.value().balise_groups()) {
    const double back_m = sign * mark.distance_m;
    if (back_m < 0 || back_m >= most_m) continue;
    groups.push_back({mark.group, nullptr, mark.nominal_is_along_path, !ahead, -mark.distance_m});
  }
  std::ranges::sort(groups, {}, [](const Reference& one) { return std::abs(one.foot_m); });
  for (size_t i = 0; i + 1 < groups.size(); ++i)  // round a ring it may be the group itself
    if (groups[i + 1].group != groups[i].group) groups[i].previous = groups[i + 1].group;
  return groups;
}

std::optional<Reference> nearest_of(const std::vector<Reference>& groups) {
  if (groups.empty()) return std::nullopt;
  Reference nearest = groups.front();
  for (size_t i = 1; i < std::min(groups.size(), kRemembered + 1); ++i) {
    const Reference& one = groups[i];
    nearest.earlier.push_back(
        {one.group, one.previous, one.nominal_along, one.from_previous_along, one.foot_m - nearest.foot_m});
  }
  return nearest;
}

}  // namespace railfix::tpr_publisher
