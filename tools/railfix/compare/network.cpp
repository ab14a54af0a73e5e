#include "compare/network.hpp"

#include <algorithm>
#include <functional>
#include <numeric>
#include <queue>
#include <utility>

#include "track/ways.hpp"

namespace railfix::compare {

Network::Network(const track::Map& map) : part_(map.edges.size()) {
  const track::Junctions junctions(map);
  std::iota(part_.begin(), part_.end(), size_t{0});
  const auto part_of = [&](size_t edge) {
    while (part_[edge] != edge) edge = part_[edge] = part_[part_[edge]];
    return edge;
  };
  for (const auto& edge : map.edges) {
    length_m_.push_back(edge.alignment.length_m());
    for (const bool forward : {true, false}) {
      auto& runs = after_.emplace_back();
      for (const auto& next : junctions.after({&edge, forward})) {
        const size_t next_edge = next.edge->id - 1;
        runs.push_back(2 * next_edge + (next.forward ? 0 : 1));
        part_[part_of(edge.id - 1)] = part_of(next_edge);
      }
    }
  }
  for (size_t edge = 0; edge < part_.size(); ++edge) part_[edge] = part_of(edge);
  for (const auto& group : map.balise_groups) {
    if (map.edge(group.edge) != nullptr) groups_[group.nid_lrbg()].push_back({group.edge - 1, group.offset_m});
  }
}

bool Network::no_way(uint32_t nid_lrbg, uint32_t other_nid_lrbg, double longest_m) const {
  const auto from = groups_.find(nid_lrbg);
  const auto to = groups_.find(other_nid_lrbg);
  if (from == groups_.end() || to == groups_.end()) return false;
  return std::ranges::all_of(from->second, [&](const Place& a) {
    return std::ranges::all_of(
        to->second, [&](const Place& b) { return part_[a.edge] == part_[b.edge] && !leads_to(a, b, longest_m); });
  });
}

/// Dijkstra, beginning either way.
bool Network::leads_to(const Place& from, const Place& to, double longest_m) const {
  using Begin = std::pair<double, size_t>;  // way to where the run begins, and the run
  std::priority_queue<Begin, std::vector<Begin>, std::greater<>> open;
  std::unordered_map<size_t, double> least_m;  // of a large map few are near
  const auto reach = [&](double way_m, size_t run) {
    if (way_m > longest_m) return;
    const auto [known, is_new] = least_m.try_emplace(run, way_m);
    if (!is_new && way_m >= known->second) return;
    known->second = way_m;
    open.emplace(way_m, run);
  };
  for (const size_t run : {2 * from.edge, 2 * from.edge + 1}) {
    const double into = into_m(run, from.offset_m);
    if (from.edge == to.edge && into_m(run, to.offset_m) >= into) {
      if (into_m(run, to.offset_m) - into <= longest_m) return true;
    }
    for (const size_t next : after_[run]) reach(length_m_[from.edge] - into, next);
  }
  while (!open.empty()) {
    const auto [way_m, run] = open.top();
    open.pop();
    if (way_m > least_m[run]) continue;
    if (run / 2 == to.edge && way_m + into_m(run, to.offset_m) <= longest_m) return true;
    for (const size_t next : after_[run]) reach(way_m + length_m_[run / 2], next);
  }
  return false;
}

}  // namespace railfix::compare
