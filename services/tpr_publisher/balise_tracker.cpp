#include "tpr_publisher/balise_tracker.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "tpr_publisher/position_report.hpp"
#include "track/path.hpp"

namespace railfix::tpr_publisher {

namespace {

using track::Direction;
using track::EdgePosition;

constexpr double kAsideM = 0.001;
constexpr double kLongestStepM = 500.0;  // farther apart two places are no way but a jump
constexpr double kSameWayM = 1.0;        // a group passed again after another way than back is passed anew
constexpr double kAtSwitchM = 10.0;      // a switch is doubted a little before the foot's estimate reaches it, ...
constexpr double kNearSwitchM = 50.0;    // ... and where there is none behind even further
constexpr double kDeclaredM = 3000.0;    // so far behind a switch its declaration may still be taken back
constexpr double kTurnedM = 0.3;         // less is no other direction of running
constexpr double kBeforeSwitchM = 0.01;  // on the stem

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

/// The same group, and the train looks the same way at it.
bool agree(const std::optional<Reference>& reference, const Reference& before) {
  return reference && reference->group == before.group && orientation(*reference) == orientation(before);
}

/// A train that runs on that way comes to the group.
bool lies_further(const Reference& reference, bool forwards) {
  return forwards ? reference.foot_m < 0 : reference.foot_m > 0;
}

}  // namespace

BaliseTracker::BaliseTracker(std::shared_ptr<const track::Map> map, double search_behind_m)
    : map_(std::move(map)), ways_(*map_), search_behind_m_(search_behind_m) {
  for (const auto& group : map_->balise_groups) groups_on_[group.edge].push_back(&group);
}

void BaliseTracker::lose() {
  last_.reset();
  step_m_.reset();
  leg_.reset();
  reference_.reset();
}

void BaliseTracker::update(const EdgePosition& place, bool declared, bool heard) {
  step_m_.reset();
  const track::Edge* edge = map_->edge(place.edge);
  if (edge == nullptr || !std::isfinite(place.offset_m)) return lose();
  EdgePosition foot = place;
  foot.offset_m = std::clamp(foot.offset_m, 0.0, edge->alignment.length_m());
  const auto before = reference_;
  if (!heard && last_) {  // over which leg it went meanwhile nobody knows
    const auto step = step_to(foot);
    if (!step || step->divides) lose();
  }
  if (!declared) {
    go_undeclared(foot);
  } else if (!go_declared(foot)) {
    acquire(foot);
    if (before && !agree(reference_, *before)) ++taken_back_;
  } else if (front_turned_) {
    acquire_behind_turned_front(foot);
  }
  last_ = foot;
}

std::optional<double> BaliseTracker::undeclared_m() const {
  if (!leg_is_guess()) return std::nullopt;
  return std::abs(leg_->turns.way_m());
}

// Where the track divides on this step the last place is the stem. Doubted elsewhere, it is an earlier declaration that
// is taken back.
BaliseTracker::LegSinceSwitch BaliseTracker::leg_since(const EdgePosition& foot) {
  if (!last_) return {};
  const auto step = step_to(foot);
  if (step && step->divides) return leg_from(*last_, 0, step->way_m > 0);
  if (leg_) return *leg_;
  const auto path = track::Path::follow(map_, *last_, kDeclaredM, kDeclaredM);
  if (!path.ok()) return {};
  const double sign = forwards_ ? 1.0 : -1.0;
  std::optional<double> next_m;  // in the running direction
  std::optional<double> passed_m;
  double met_m = -kDeclaredM;  // it may have come from elsewhere
  for (const auto& one : path.value().switches()) {
    const double further_m = sign * one.distance_m;
    if (one.ahead != forwards_ && further_m <= 0) met_m = std::max(met_m, further_m);
    if (one.ahead != forwards_) continue;
    auto& nearest_m = further_m > 0 ? next_m : passed_m;
    if (!nearest_m || std::abs(further_m) < std::abs(*nearest_m)) nearest_m = further_m;
  }
  if (passed_m && *passed_m < met_m) passed_m.reset();
  // A little before it already, because fusion and whoever declares the track do not place the train alike.
  const bool at_next = next_m && *next_m < kAtSwitchM && !(passed_m && -*passed_m < *next_m);
  if (at_next || (!passed_m && next_m && *next_m < kNearSwitchM)) return leg_from(*last_, 0, forwards_);
  if (!passed_m) return {};
  const double stem_m = sign * (*passed_m - kBeforeSwitchM);
  return leg_from(path.value().position_at(stem_m), -stem_m, forwards_);
}

// A group beyond the switch is on one of its legs, and nobody knows whether on this one.
BaliseTracker::LegSinceSwitch BaliseTracker::leg_from(const EdgePosition& stem, double way_m, bool forwards) const {
  LegSinceSwitch leg{stem, reference_, {}};
  if (way_m != 0) leg.turns.run(way_m);
  auto& reference = leg.reference;
  if (!reference) return leg;
  reference->foot_m -= way_m;
  if (lies_further(*reference, forwards)) reference = front_first(forwards) ? nearest_behind(stem) : std::nullopt;
  return leg;
}

// It has backed out over the switch, and goes on over another leg than the one on which its group lies.
void BaliseTracker::leave_leg(const Step& step) {
  if (!step.divides || !reference_) return;
  const bool forwards = step.way_m > 0;
  if (!lies_further(*reference_, forwards)) return;
  const bool leads_there = std::ranges::any_of(step.groups, [&](const Passed& mark) {
    return mark.group == reference_->group &&
           std::abs(mark.way_m + reference_->foot_m) <= kSameWayM + reference_->doubt_m;
  });
  if (!leads_there) reference_ = front_first(forwards) ? nearest_behind(*last_) : std::nullopt;
}

void BaliseTracker::go_back_to(LegSinceSwitch leg) {
  leg_ = std::move(leg);
  leg_declared_ = false;
  const auto* group = reference_ ? reference_->group : nullptr;
  reference_ = leg_->reference;
  if (group != (reference_ ? reference_->group : nullptr)) ++taken_back_;
  if (reference_) reference_->foot_m += leg_->turns.way_m();
}

void BaliseTracker::go_undeclared(const EdgePosition& foot) {
  const bool anew = !leg_is_guess();
  if (anew) go_back_to(leg_since(foot));
  if (!leg_->from) {
    if (const auto step = last_ ? step_to(foot) : std::nullopt) step_m_ = step->way_m;
    return;
  }
  const double before_m = leg_->turns.way_m();
  if (const auto step = step_to(foot)) {
    note_direction(step->way_m);
    leg_->turns.run(step->way_m);
    leave_doubted(*step);
  } else if (const auto ways = ways_between(*map_, ways_, *leg_->from, foot, before_m); ways && !ways->empty()) {
    leg_->turns.run(ways->front().length_m - before_m);  // onto another leg, behind one more switch
  } else {
    leg_->from.reset();
    reference_.reset();
  }
  if (leg_->from) step_m_ = leg_->turns.way_m() - before_m;
  if (!reference_) return;
  reference_->foot_m += leg_->turns.way_m() - before_m;
  if (anew || foot.edge != last_->edge) doubt_legs(foot);
}

// The group that it runs back to may lie beyond this switch on one of its legs.
void BaliseTracker::leave_doubted(const Step& step) {
  if (!step.divides || !reference_) return;
  const bool forwards = step.way_m > 0;
  if (!lies_further(*reference_, forwards)) return;
  const double most_m = std::abs(reference_->foot_m) + kLongestStepM;
  if (every_way_leads_to(*map_, ways_, *last_, forwards, reference_->group->edge, most_m)) return;
  reference_.reset();
  leg_->reference.reset();
}

// Where legs have joined again nobody knows over which one the train came.
void BaliseTracker::doubt_legs(const EdgePosition& foot) {
  const double way_m = leg_->turns.way_m();
  const auto ways = ways_between(*map_, ways_, *leg_->from, foot, way_m);
  const double apart_m = ways && !ways->empty() ? most_apart_m(*ways, way_m) : legs_differ_m(way_m);
  reference_->doubt_m = std::max(leg_->reference->doubt_m, apart_m);
}

bool BaliseTracker::go_declared(const EdgePosition& foot) {
  if (!last_) return false;
  if (!leg_is_guess()) {
    if (auto step = step_to(foot)) {
      step_m_ = step->way_m;
      run_on(step->way_m);
      leave_leg(*step);
      pass(std::move(step->groups), step->way_m);
      return true;
    }
    if (!leg_) return false;
    go_back_to(*std::exchange(leg_, std::nullopt));  // another leg than was declared before
  }
  auto leg = *std::exchange(leg_, std::nullopt);
  if (!leg.from) return false;
  const auto step = step_to(foot);
  const double counted_m = leg.turns.way_m();
  const double about_m = counted_m + (step ? step->way_m : 0.0);
  const auto found = ways_between(*map_, ways_, *leg.from, foot, about_m);
  if (!found || found->empty()) return false;
  const auto& ways = *found;
  const double length_m = ways.front().length_m;
  reference_ = leg.reference;
  if (reference_) reference_->doubt_m = std::max(reference_->doubt_m, most_apart_m(ways, length_m));
  step_m_ = length_m - counted_m;
  leg.turns.run(*step_m_);
  const auto groups = groups_on(ways);
  const auto& points = leg.turns.points();
  for (size_t i = 1; i < points.size(); ++i) {
    auto passed = groups;
    for (auto& mark : passed)
      mark.way_m += length_m - points[i - 1];  // from the last place to where this stretch began
    pass(std::move(passed), points[i] - points[i - 1]);
  }
  leg_ = std::move(leg);
  leg_declared_ = true;
  return true;
}

void BaliseTracker::run_on(double way_m) {
  note_direction(way_m);
  if (!leg_) return;
  leg_->turns.run(way_m);
  if (std::abs(leg_->turns.way_m()) > kDeclaredM) leg_.reset();
}

void BaliseTracker::note_direction(double way_m) {
  moved_back_m_ = std::max(0.0, moved_back_m_ + (forwards_ ? -way_m : way_m));
  if (moved_back_m_ <= kTurnedM) return;
  forwards_ = !forwards_;
  moved_back_m_ = 0;
}

/// At their distances from where the ways end. Beyond both ends the train may have been as well, before it turned:
/// there, too, up to the next switch only.
std::vector<BaliseTracker::Passed> BaliseTracker::groups_on(const std::vector<WayBetween>& ways) const {
  std::vector<Passed> common;
  for (const auto& way : ways) {
    auto route = way.route;
    const double reach_m = kLongestStepM + std::abs(way.length_m);
    for (auto next = ways_.after(route.legs().back().run); next.size() == 1 && route.end_m() < reach_m;
         next = ways_.after(next.front()))
      route.push_ahead(next.front());
    for (auto next = ways_.before(route.legs().front().run); next.size() == 1 && route.begin_m() > -reach_m;
         next = ways_.before(next.front()))
      route.push_behind(next.front());
    const auto path = track::Path::along(map_, route, ways_);
    if (&way == &ways.front()) {
      for (const auto& mark : path.balise_groups())
        common.push_back({mark.group, mark.distance_m, mark.nominal_is_along_path});
      continue;
    }
    std::erase_if(common, [&](Passed& known) {
      const auto& marks = path.balise_groups();
      const auto same = std::find_if(marks.begin(), marks.end(), [&](const track::PathBaliseGroup& mark) {
        return mark.group == known.group && mark.nominal_is_along_path == known.nominal_along;
      });
      if (same == marks.end()) return true;
      known.doubt_m = std::max(known.doubt_m, std::abs(same->distance_m - known.way_m));
      return false;
    });
  }
  return common;
}

std::optional<Reference> BaliseTracker::find(uint32_t nid_lrbg, double ahead_m,
                                             std::optional<double> expected_foot_m) const {
  if (reference_) {
    if (auto found = reference_->remembered(nid_lrbg, expected_foot_m)) return found;
  }
  if (!last_ || leg_is_guess()) return std::nullopt;
  const auto groups = groups_on_only_way(map_, *last_, !front_at_other_end_, ahead_m);
  const auto one =
      std::ranges::find_if(groups, [&](const Reference& other) { return other.group->nid_lrbg() == nid_lrbg; });
  if (one == groups.end()) return std::nullopt;
  Reference found = *one;
  found.previous = nullptr;  // the one that the train will come from has not been passed either
  return found;
}

void BaliseTracker::turn_front(bool is_at_other_end) {
  if (is_at_other_end == front_at_other_end_) return;
  front_at_other_end_ = is_at_other_end;
  front_turned_ = true;
  if (last_ && !leg_is_guess()) acquire_behind_turned_front(*last_);
}

void BaliseTracker::acquire_behind_turned_front(const EdgePosition& foot) {
  front_turned_ = false;
  if (!reference_ || !reference_->passed) acquire(foot);
}

std::optional<BaliseTracker::Step> BaliseTracker::step_to(const EdgePosition& foot) const {
  // A group where edges meet may lie on the next one.
  const bool inside = foot.offset_m > 0 && foot.offset_m < map_->edge(foot.edge)->alignment.length_m();
  if (const auto step = inside ? step_on_edge(foot) : step_over_edges(foot)) return step;
  return inside ? step_over_edges(foot) : step_on_edge(foot);
}

std::optional<BaliseTracker::Step> BaliseTracker::step_on_edge(const EdgePosition& foot) const {
  if (foot.edge != last_->edge || foot.direction != last_->direction) return std::nullopt;
  const track::Edge& edge = *map_->edge(foot.edge);
  const bool over_its_end = std::abs(foot.offset_m - last_->offset_m) > 0.5 * edge.alignment.length_m();
  if (edge.from_node == edge.to_node && over_its_end) return std::nullopt;  // a ring of one edge
  const double sign = sign_of(foot.direction);
  Step step{sign * (foot.offset_m - last_->offset_m)};
  if (std::abs(step.way_m) > kLongestStepM) return std::nullopt;
  if (const auto groups = groups_on_.find(foot.edge); groups != groups_on_.end()) {
    for (const auto* group : groups->second) {
      step.groups.push_back(
          {group, sign * (group->offset_m - last_->offset_m), group->nominal_is_forward == (sign > 0)});
    }
  }
  return step;
}

std::optional<BaliseTracker::Step> BaliseTracker::step_over_edges(const EdgePosition& foot) const {
  // From here a diverging way ahead is not found, but seen from there it is the only way back; and the other way round.
  for (const bool from_last : {true, false}) {
    const auto path = track::Path::follow(map_, from_last ? *last_ : foot, kLongestStepM, kLongestStepM);
    if (!path.ok()) continue;
    const auto distance = distance_on(path.value(), from_last ? foot : *last_);
    if (!distance) continue;
    const double origin_m = from_last ? 0.0 : *distance;  // of the last place on this path
    Step step{from_last ? *distance : -*distance};
    const double low_m = origin_m + std::min(step.way_m, 0.0);
    const double high_m = origin_m + std::max(step.way_m, 0.0);
    step.divides = std::ranges::any_of(path.value().switches(), [&](const track::PathSwitch& one) {
      return one.ahead == (step.way_m > 0) && one.distance_m >= low_m && one.distance_m <= high_m;
    });
    for (const auto& mark : path.value().balise_groups()) {
      step.groups.push_back({mark.group, mark.distance_m - origin_m, mark.nominal_is_along_path});
    }
    return step;
  }
  return std::nullopt;
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
    const double foot_m = step_m - mark.way_m;
    const bool again = reference_ && reference_->group == mark.group;
    // A foot that trembles above a group at a halt passes nothing.
    if (again && reference_->furthest_m > kSameWayM) {
      ++passed_again_;
      reference_->furthest_m = 0;
    }
    // Over and back it stays as it is. Round a loop it is passed anew, and no group lies before it.
    if (again && reference_->nominal_along == mark.nominal_along &&
        std::abs(reference_->foot_m - foot_m) <= kSameWayM + reference_->doubt_m) {
      reference_->passed = true;
      continue;
    }
    const double from_previous_m = reference_ ? reference_->foot_m - foot_m : 0;
    const bool tells = reference_ && !again && std::abs(from_previous_m) > reference_->doubt_m + mark.doubt_m;
    const auto* previous = tells ? reference_->group : nullptr;
    Reference present{mark.group, previous, mark.nominal_along, from_previous_m > 0, foot_m, mark.doubt_m, 0, true};
    if (reference_) present = passed_behind(std::move(present), *reference_, search_behind_m_);
    reference_ = std::move(present);
  }
  if (reference_) reference_->furthest_m = std::max(reference_->furthest_m, std::abs(reference_->foot_m));
}

void BaliseTracker::acquire(const EdgePosition& foot) {
  leg_.reset();
  front_turned_ = false;
  reference_ = nearest_behind(foot);
}

// Where tracks have met behind the train nobody knows from which one it came.
std::optional<Reference> BaliseTracker::nearest_behind(const EdgePosition& foot) const {
  return nearest_of(groups_on_only_way(map_, foot, front_at_other_end_, search_behind_m_));
}

}  // namespace railfix::tpr_publisher
