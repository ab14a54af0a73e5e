#include "tpr_publisher/balise_tracker.hpp"

#include <algorithm>
#include <cmath>

#include "track/path.hpp"

namespace railfix::tpr_publisher {

namespace {

using track::Direction;
using track::EdgePosition;

constexpr double kAsideM = 0.001;
constexpr double kLongestStepM = 500.0;  // farther apart two places are no way but a jump

double sign_of(Direction direction) {
  return direction == Direction::reverse ? -1.0 : 1.0;
}

/// Distance of `foot` on the path, when the path runs over it in the foot's own direction.
std::optional<double> distance_on(const track::Path& path, const EdgePosition& foot) {
  const auto distance = path.distance_of(foot.edge, foot.offset_m);
  if (!distance) return std::nullopt;
  for (const double aside_m : {kAsideM, -kAsideM}) {  // where edges meet the place itself belongs to either
    const auto place = path.position_at(*distance + aside_m);
    if (place.edge == foot.edge && place.direction == foot.direction) return distance;
  }
  return std::nullopt;
}

}  // namespace

BaliseTracker::BaliseTracker(std::shared_ptr<const track::Map> map, double search_behind_m)
    : map_(std::move(map)), search_behind_m_(search_behind_m) {
  for (const auto& group : map_->balise_groups) groups_on_[group.edge].push_back(&group);
}

void BaliseTracker::lose() {
  last_.reset();
  reference_.reset();
}

void BaliseTracker::update(const EdgePosition& place) {
  const track::Edge* edge = map_->edge(place.edge);
  if (edge == nullptr || !std::isfinite(place.offset_m)) return lose();
  EdgePosition foot = place;
  foot.offset_m = std::clamp(foot.offset_m, 0.0, edge->alignment.length_m());
  if (!last_ || (!step_on_edge(foot) && !step_over_edges(foot))) acquire(foot);
  last_ = foot;
}

std::optional<double> BaliseTracker::foot_beyond_m(uint32_t nid_lrbg) const {
  if (reference_ && reference_->group->nid_lrbg() == nid_lrbg) return reference_->foot_m;
  if (!last_) return std::nullopt;
  const auto path = track::Path::follow(map_, *last_, 0, search_behind_m_);
  if (!path.ok()) return std::nullopt;
  std::optional<double> beyond_m;
  for (const auto& mark : path.value().balise_groups()) {  // by distance: the last one is the nearest
    if (mark.distance_m <= 0 && mark.group->nid_lrbg() == nid_lrbg) beyond_m = -mark.distance_m;
  }
  return beyond_m;
}

bool BaliseTracker::step_on_edge(const EdgePosition& foot) {
  if (foot.edge != last_->edge || foot.direction != last_->direction) return false;
  const double sign = sign_of(foot.direction);
  std::vector<Passed> passed;
  if (const auto groups = groups_on_.find(foot.edge); groups != groups_on_.end()) {
    for (const auto* group : groups->second) {
      passed.push_back({group, sign * (group->offset_m - last_->offset_m), group->nominal_is_forward == (sign > 0)});
    }
  }
  pass(std::move(passed), sign * (foot.offset_m - last_->offset_m));
  return true;
}

bool BaliseTracker::step_over_edges(const EdgePosition& foot) {
  // From here a diverging way ahead is not found, but seen from there it is the only way back; and the other way round.
  for (const bool from_last : {true, false}) {
    const auto path = track::Path::follow(map_, from_last ? *last_ : foot, kLongestStepM, kLongestStepM);
    if (!path.ok()) continue;
    const auto distance = distance_on(path.value(), from_last ? foot : *last_);
    if (!distance) continue;
    const double origin_m = from_last ? 0.0 : *distance;  // of the last place on this path
    std::vector<Passed> passed;
    for (const auto& mark : path.value().balise_groups()) {
      passed.push_back({mark.group, mark.distance_m - origin_m, mark.nominal_is_along_path});
    }
    pass(std::move(passed), from_last ? *distance : -*distance);
    return true;
  }
  return false;
}

void BaliseTracker::pass(std::vector<Passed> passed, double step_m) {
  if (reference_) reference_->foot_m += step_m;
  const bool along = step_m > 0;
  std::erase_if(passed, [&](const Passed& mark) {
    return along ? mark.way_m <= 0 || mark.way_m > step_m : mark.way_m > 0 || mark.way_m <= step_m;
  });
  std::sort(passed.begin(), passed.end(),
            [&](const Passed& a, const Passed& b) { return along ? a.way_m < b.way_m : a.way_m > b.way_m; });
  for (const auto& mark : passed) {
    if (reference_ && reference_->group == mark.group) continue;  // passed again: the same group stays the reference
    const auto* previous = reference_ ? reference_->group : nullptr;
    reference_ = Reference{mark.group, previous, mark.nominal_along, along, step_m - mark.way_m};
  }
}

void BaliseTracker::acquire(const EdgePosition& foot) {
  reference_.reset();
  const auto path = track::Path::follow(map_, foot, 0, search_behind_m_);
  if (!path.ok()) return;
  for (const auto& mark : path.value().balise_groups()) {  // by distance: the last one is the nearest
    if (mark.distance_m > 0) continue;
    const auto* previous = reference_ ? reference_->group : nullptr;
    reference_ = Reference{mark.group, previous, mark.nominal_is_along_path, true, -mark.distance_m};
  }
}

}  // namespace railfix::tpr_publisher
