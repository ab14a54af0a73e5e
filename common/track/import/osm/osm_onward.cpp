#include "track/import/osm/osm_onward.hpp"

#include <algorithm>
#include <cmath>

#include "core/units.hpp"
#include "track/import/fit/plane.hpp"

namespace railfix::track {
namespace {

// As long as the curve of a turnout: shorter ones tell the drawing's errors, longer ones what comes behind.
constexpr double kChordM = 30.0;
constexpr double kSameWayRad = core::rad_from_deg(3.0);

/// The points as met from one end on.
Eigen::Vector2d point_at(const OsmChain& chain, bool from_end, size_t i) {
  return chain.shape[from_end ? chain.shape.size() - 1 - i : i];
}

double first_heading(const OsmChain& chain, bool from_end) {
  return heading_of(point_at(chain, from_end, 1) - point_at(chain, from_end, 0));
}

bool is_running_line(const OsmTags& tags) {
  const std::string usage = value_of(tags, "usage");
  return (usage == "main" || usage == "branch") && !is_set(tags, "service");
}

}  // namespace

OsmOnward::OsmOnward(const OsmData& data, const std::vector<OsmChain>& chains) : data_(data) {
  for (const OsmChain& chain : chains) {
    from_node_[chain.nodes.front()].push_back({&chain, false});
    from_node_[chain.nodes.back()].push_back({&chain, true});
  }
}

Onward OsmOnward::of(const OsmChain& chain, bool at_end) const {
  const OsmWay& way = way_of(chain, at_end);
  return {heading_rad({&chain, at_end}), way.id, line_in(way.tags), is_running_line(way.tags)};
}

const OsmWay& OsmOnward::way_of(const OsmChain& chain, bool at_end) const {
  return data_.ways[at_end ? chain.ways.back() : chain.ways.front()];
}

/// The chain that runs on most straightly from where this one ends, of the same way first.
std::optional<OsmOnward::Run> OsmOnward::after(const Run& run) const {
  const double arriving_rad = first_heading(*run.chain, !run.from_end) + core::kPi;
  const int64_t way = way_of(*run.chain, !run.from_end).id;
  std::optional<Run> best;
  double least_rad = kSharpestTurnRad;
  for (const Run& next : from_node_.at(run.from_end ? run.chain->nodes.front() : run.chain->nodes.back())) {
    const double turn_rad = std::abs(core::wrap_pi(first_heading(*next.chain, next.from_end) - arriving_rad));
    const bool same_way = way_of(*next.chain, next.from_end).id == way;
    const double cost_rad = turn_rad - (same_way ? kSameWayRad : 0.0);
    if (turn_rad > kSharpestTurnRad || cost_rad >= least_rad) continue;
    least_rad = cost_rad;
    best = next;
  }
  return best;
}

double OsmOnward::heading_rad(Run run) const {
  const Eigen::Vector2d from = point_at(*run.chain, run.from_end, 0);
  Eigen::Vector2d to = from;
  for (double left_m = kChordM; left_m > 0;) {
    for (size_t i = 1; i < run.chain->shape.size() && left_m > 0; ++i) {
      const Eigen::Vector2d before = point_at(*run.chain, run.from_end, i - 1);
      const Eigen::Vector2d step = point_at(*run.chain, run.from_end, i) - before;
      to = before + step * std::min(1.0, left_m / step.norm());
      left_m -= step.norm();
    }
    const std::optional<Run> next = after(run);
    if (!next) break;
    run = *next;
  }
  return heading_of(to - from);
}

}  // namespace railfix::track
