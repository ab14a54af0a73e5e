#include "track/ways.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "core/units.hpp"

namespace railfix::track {
namespace {

constexpr size_t kMostLegs = 100000;  // ends a way round a ring of tiny edges
constexpr double kCornerM = 12.0;
constexpr double kLeastCornerRad = 0.005;  // less is how points were rounded
constexpr double kMostCornerRad = 0.2;     // more is no turnout's
constexpr double kDivergesRad = 10.0;      // beyond every turn

double corner_rad(const Run& run, const Run& next) {
  if (run.edge->is_drawn || next.edge->is_drawn) return 0.0;
  const double left_rad = core::wrap_pi(run.pose_at(run.length_m()).heading_rad - next.pose_at(0).heading_rad);
  return std::abs(left_rad) < kLeastCornerRad || std::abs(left_rad) > kMostCornerRad ? 0.0 : left_rad;
}

}  // namespace

PlanPose Run::pose_at(double into_m) const {
  const PlanPose pose = edge->alignment.at(offset_m(into_m)).pose;
  return forward ? pose : turned_round(pose);
}

Run run_of(const Map& map, const EdgePosition& place) {
  return {map.edge(place.edge), place.direction != Direction::reverse};
}

PlanPose cab_pose(const Map& map, const EdgePosition& place) {
  const Run run = run_of(map, place);
  return run.pose_at(run.into_m(place.offset_m));
}

double turn_rad(const Run& run, const Run& next) {
  return std::abs(core::wrap_pi(next.pose_at(0).heading_rad - run.pose_at(run.length_m()).heading_rad));
}

bool leads_on(const Run& run, const Run& next) {
  return turn_rad(run, next) <= core::kPi / 2 || run.edge->is_drawn || next.edge->is_drawn;
}

Junctions::Junctions(const Map& map) : map_(&map) {
  for (const Connection& connection : map.connections) by_node_.push_back(&connection);
  std::ranges::stable_sort(by_node_, {}, &Connection::node);
}

std::vector<Run> Junctions::after(const Run& run) const {
  const uint32_t node = run.forward ? run.edge->to_node : run.edge->from_node;
  std::vector<std::pair<double, Run>> found;
  for (auto at = std::ranges::lower_bound(by_node_, node, {}, &Connection::node);
       at != by_node_.end() && (*at)->node == node; ++at) {
    const Connection* met = *at;
    if (met->edge_a != run.edge->id && met->edge_b != run.edge->id) continue;
    const Edge* other = map_->edge(met->edge_a == run.edge->id ? met->edge_b : met->edge_a);
    if (other == nullptr) continue;
    for (const bool forward : {true, false}) {
      const Run next{other, forward};
      if ((forward ? other->from_node : other->to_node) != node || next == run.reversed()) continue;
      if (!leads_on(run, next)) continue;
      // Both ends of a balloon loop meet the stem: each of the two connections says both.
      const double cost = turn_rad(run, next) + (met->diverging ? kDivergesRad : 0.0);
      const auto known = std::ranges::find(found, next, &std::pair<double, Run>::second);
      if (known == found.end()) {
        found.emplace_back(cost, next);
      } else {
        known->first = std::min(known->first, cost);
      }
    }
  }
  std::ranges::stable_sort(found, {}, &std::pair<double, Run>::first);
  std::vector<Run> runs;
  runs.reserve(found.size());
  for (const auto& [cost, next] : found) runs.push_back(next);
  return runs;
}

Ways::Ways(const Map& map) {
  const Junctions junctions(map);
  after_.reserve(2 * map.edges.size());
  for (const Edge& edge : map.edges) {
    for (const bool forward : {true, false}) after_.push_back(junctions.after({&edge, forward}));
  }
}

std::vector<Run> Ways::before(const Run& run) const {
  std::vector<Run> found = after(run.reversed());
  for (Run& before : found) before = before.reversed();
  return found;
}

Route::Route(const Run& run, double offset_m, double place_m) {
  legs_.push_back({run, place_m - run.into_m(offset_m)});
}

void Route::push_ahead(const Run& run) {
  legs_.push_back({run, end_m(), corner_rad(legs_.back().run, run)});
}

void Route::push_behind(const Run& run) {
  legs_.front().corner_rad = corner_rad(run, legs_.front().run);
  legs_.push_front({run, begin_m() - run.length_m()});
}

void Route::drop_ahead() {
  if (legs_.size() > 1) legs_.pop_back();
}

void Route::drop_behind() {
  if (legs_.size() > 1) legs_.pop_front();
}

size_t Route::index_at(double distance_m) const {
  const auto after = std::upper_bound(legs_.begin(), legs_.end(), distance_m,
                                      [](double distance, const Leg& leg) { return distance < leg.begin_m; });
  return after == legs_.begin() ? 0 : static_cast<size_t>(after - legs_.begin()) - 1;
}

EdgePosition Route::position_at(double distance_m) const {
  const Leg& leg = leg_at(distance_m);
  return leg.run.at(std::clamp(distance_m - leg.begin_m, 0.0, leg.run.length_m()));
}

std::optional<double> Route::distance_of(const EdgePosition& place, double near_m) const {
  std::optional<double> best;
  for (const Leg& leg : legs_) {
    if (leg.run.edge->id != place.edge) continue;
    if (place.direction != Direction::unknown && place.direction != leg.run.direction()) continue;
    const double distance = leg.begin_m + leg.run.into_m(place.offset_m);
    if (!best || std::abs(distance - near_m) < std::abs(*best - near_m)) best = distance;
  }
  return best;
}

double Route::corners_at(size_t at, double distance_m) const {
  double sum_rad = 0;
  for (size_t i = at; i < legs_.size() && legs_[i].begin_m - distance_m < kCornerM; ++i) {
    if (std::abs(legs_[i].begin_m - distance_m) < kCornerM) sum_rad += legs_[i].corner_rad;
  }
  for (size_t i = at; i-- > 0 && distance_m - legs_[i].begin_m < kCornerM;) sum_rad += legs_[i].corner_rad;
  return sum_rad;
}

double Route::curvature_at(double distance_m) const {
  const size_t at = index_at(distance_m);
  const Leg& leg = legs_[at];
  const double curvature = leg.run.edge->alignment.curvature_at(leg.run.offset_m(distance_m - leg.begin_m));
  return (leg.run.forward ? curvature : -curvature) + corners_at(at, distance_m) / (2 * kCornerM);
}

void follow_on(Route& route, const Ways& ways, double near_m, double ahead_m, double behind_m) {
  while (route.end_m() < near_m + ahead_m && route.legs().size() < kMostLegs) {
    const auto& next = ways.after(route.legs().back().run);
    if (next.empty()) break;
    route.push_ahead(next.front());
  }
  while (route.begin_m() > near_m - behind_m && route.legs().size() < kMostLegs) {
    const auto before = ways.before(route.legs().front().run);
    if (before.empty()) break;
    route.push_behind(before.front());
  }
}

}  // namespace railfix::track
