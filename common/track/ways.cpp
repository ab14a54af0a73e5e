#include "track/ways.hpp"

#include <algorithm>
#include <cmath>

#include "core/units.hpp"

namespace railfix::track {
namespace {

double leaving_heading(const Run& run) {
  return run.edge->alignment.at(run.forward ? 0.0 : run.length_m()).pose.heading_rad + (run.forward ? 0.0 : core::kPi);
}
double arriving_heading(const Run& run) {
  return leaving_heading(run.reversed()) + core::kPi;
}

constexpr double kCornerM = 12.0;
constexpr double kLeastCornerRad = 0.005;  // less is how points were rounded
constexpr double kMostCornerRad = 0.2;     // more is no turnout's

double corner_rad(const Run& run, const Run& next) {
  if (run.edge->is_drawn || next.edge->is_drawn) return 0.0;
  const double left_rad = core::wrap_pi(arriving_heading(run) - leaving_heading(next));
  return std::abs(left_rad) < kLeastCornerRad || std::abs(left_rad) > kMostCornerRad ? 0.0 : left_rad;
}

}  // namespace

double turn_rad(const Run& run, const Run& next) {
  return std::abs(core::wrap_pi(leaving_heading(next) - arriving_heading(run)));
}

bool leads_on(const Run& run, const Run& next) {
  return turn_rad(run, next) <= core::kPi / 2 || run.edge->is_drawn || next.edge->is_drawn;
}

Ways::Ways(const Map& map) : after_(2 * map.edges.size()) {
  std::vector<std::vector<double>> costs(after_.size());
  const auto connect = [&](const Connection& connection, uint32_t from, uint32_t to) {
    const Edge* edge = map.edge(from);
    const Edge* next = map.edge(to);
    if (edge == nullptr || next == nullptr) return;
    for (const bool forward : {true, false}) {
      if ((forward ? edge->to_node : edge->from_node) != connection.node) continue;
      for (const bool next_forward : {true, false}) {
        if ((next_forward ? next->from_node : next->to_node) != connection.node) continue;
        const Run run{edge, forward};
        const Run way{next, next_forward};
        if (way == run.reversed()) continue;
        if (!leads_on(run, way)) continue;
        const double cost = turn_rad(run, way) + (connection.diverging ? 10.0 : 0.0);
        auto& found = after_[index(run)];
        auto& cost_of = costs[index(run)];
        const auto place = std::upper_bound(cost_of.begin(), cost_of.end(), cost) - cost_of.begin();
        found.insert(found.begin() + place, way);
        cost_of.insert(cost_of.begin() + place, cost);
      }
    }
  };
  for (const Connection& connection : map.connections) {
    connect(connection, connection.edge_a, connection.edge_b);
    if (connection.edge_a != connection.edge_b) connect(connection, connection.edge_b, connection.edge_a);
  }
}

std::vector<Run> Ways::before(const Run& run) const {
  std::vector<Run> found = after(run.reversed());
  for (Run& before : found) before = before.reversed();
  return found;
}

Route::Route(const Run& run, double offset_m, double place_m) {
  legs_.push_back({run, place_m - (run.forward ? offset_m : run.length_m() - offset_m)});
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
  const double into = std::clamp(distance_m - leg.begin_m, 0.0, leg.run.length_m());
  return {leg.run.edge->id, leg.run.forward ? into : leg.run.length_m() - into,
          leg.run.forward ? Direction::forward : Direction::reverse};
}

std::optional<double> Route::distance_of(const EdgePosition& place, double near_m) const {
  std::optional<double> best;
  for (const Leg& leg : legs_) {
    if (leg.run.edge->id != place.edge) continue;
    if (place.direction != Direction::unknown && leg.run.forward != (place.direction == Direction::forward)) continue;
    const double distance = leg.begin_m + (leg.run.forward ? place.offset_m : leg.run.length_m() - place.offset_m);
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
  const double into = distance_m - leg.begin_m;
  const double curvature = leg.run.edge->alignment.curvature_at(leg.run.forward ? into : leg.run.length_m() - into);
  return (leg.run.forward ? curvature : -curvature) + corners_at(at, distance_m) / (2 * kCornerM);
}

}  // namespace railfix::track
