#include "track/import/finish.hpp"

#include <algorithm>
#include <cmath>
#include <optional>
#include <set>
#include <unordered_map>

#include "track/frog.hpp"
#include "track/import/told.hpp"

namespace railfix::track {
namespace {

// A reference so near to another one adds nothing, and says less well where it is than a real group does.
constexpr double kNearGroupM = 10.0;
constexpr double kToldStepM = 10.0;  // of the least distance that a refusal names

/// An edge as seen when leaving a node.
struct Branch {
  const Edge* edge = nullptr;
  bool forward = true;

  [[nodiscard]] SwitchLeg leg() const { return {&edge->alignment, forward}; }
};

Branch branch_from(const Map& map, uint32_t edge_id, uint32_t node) {
  const Edge* edge = map.edge(edge_id);
  return {edge, edge->from_node == node};
}

void add_frog(Map& map, const Node& node, const Branch& straight, const Branch& branch, double sigma_m) {
  const auto place = frog_place(straight.leg(), branch.leg());
  if (!place) return;
  const std::string name = "frog of " + (node.name.empty() ? "node " + std::to_string(node.id) : node.name);
  const auto add = [&](const Branch& on, double offset_m, double left_m) {
    const auto id = static_cast<uint32_t>(map.landmarks.size() + 1);
    map.landmarks.push_back(
        {id, LandmarkKind::frog, on.edge->id, offset_m, on.forward ? left_m : -left_m, sigma_m, name});
  };
  add(straight, place->on_straight_m, 0.5 * kGaugeM * place->side);
  add(branch, place->on_branch_m, -0.5 * kGaugeM * place->side);
}

/// The stem is the edge that both ways share; without one there is no frog between them.
void add_frogs_of(Map& map, const Node& node, const Connection& straight, const Connection& way, double sigma_m) {
  for (const auto& [stem, branch] : {std::pair(way.edge_a, way.edge_b), std::pair(way.edge_b, way.edge_a)}) {
    if (stem != straight.edge_a && stem != straight.edge_b) continue;
    const uint32_t on = stem == straight.edge_a ? straight.edge_b : straight.edge_a;
    if (on == branch || on == stem) continue;
    add_frog(map, node, branch_from(map, on, node.id), branch_from(map, branch, node.id), sigma_m);
  }
}

struct VirtualPlace {
  uint32_t edge = 0;
  double offset_m = 0;
};

uint32_t groups_along(double length_m, double every_m) {
  return static_cast<uint32_t>(std::lround(length_m / every_m));
}

/// Evenly along every edge, but for places that have a group already.
std::vector<VirtualPlace> virtual_places(const Map& map, double every_m) {
  std::set<std::pair<uint32_t, double>> taken;
  for (const BaliseGroup& group : map.balise_groups) taken.emplace(group.edge, group.offset_m);
  const auto is_taken = [&](uint32_t edge, double offset_m) {
    const auto next = taken.lower_bound({edge, offset_m - kNearGroupM});
    return next != taken.end() && next->first == edge && next->second <= offset_m + kNearGroupM;
  };
  std::vector<VirtualPlace> out;
  for (const Edge& edge : map.edges) {
    const double length_m = edge.alignment.length_m();
    const uint32_t count = groups_along(length_m, every_m);
    for (uint32_t i = 0; i < count; ++i) {
      const double offset_m = length_m * (i + 0.5) / count;
      if (!is_taken(edge.id, offset_m)) out.push_back({edge.id, offset_m});
    }
  }
  return out;
}

/// Numbers of this country that groups have already are left to them.
std::vector<uint32_t> free_numbers(const Map& map, uint32_t nid_c, uint32_t first_nid_bg) {
  std::set<uint32_t> taken;
  for (const BaliseGroup& group : map.balise_groups) {
    if (group.nid_c == nid_c) taken.insert(group.nid_bg);
  }
  std::vector<uint32_t> out;
  for (uint32_t number = first_nid_bg; number <= BaliseGroup::kLastNidBg; ++number) {
    if (!taken.contains(number)) out.push_back(number);
  }
  return out;
}

core::Error too_few_numbers(const Map& map, size_t places, size_t numbers, uint32_t nid_c, uint32_t first_nid_bg) {
  const std::string lack = std::to_string(places) + " virtual balise groups are more than NID_C " +
                           std::to_string(nid_c) + " has numbers for: " + std::to_string(numbers) + " are free from " +
                           std::to_string(first_nid_bg) + " on; ";
  const std::string in_parts = "build the map in parts, each with an NID_C of its own";
  if (numbers == 0) return {lack + "begin at a lower NID_BG or " + in_parts};
  double every_m = kToldStepM;
  while (virtual_places(map, every_m).size() > numbers) every_m += kToldStepM;
  return {lack + "place them at least " + told_m(every_m, 0) + " apart on this map or " + in_parts};
}

}  // namespace

void add_frogs(Map& map, double sigma_m) {
  std::unordered_map<uint32_t, std::vector<Connection>> ways_at;
  for (const Connection& way : map.connections) ways_at[way.node].push_back(way);
  for (const Node& node : map.nodes) {
    const std::vector<Connection>& ways = ways_at[node.id];
    for (const Connection& way : ways) {
      for (const Connection& straight : ways) {
        if (way.diverging && !straight.diverging) add_frogs_of(map, node, straight, way, sigma_m);
      }
    }
  }
}

core::Result<VirtualBalises> add_virtual_balises(Map& map, double every_m, uint32_t nid_c, uint32_t first_nid_bg,
                                                 double q_locacc_m) {
  if (!(every_m >= 1.0)) return core::Error{"virtual balise groups must be at least 1 m apart"};
  if (nid_c > BaliseGroup::kLastNidC) return core::Error{"NID_C must be between 0 and 1023"};
  const std::vector<VirtualPlace> places = virtual_places(map, every_m);
  const std::vector<uint32_t> numbers = free_numbers(map, nid_c, first_nid_bg);
  if (places.size() > numbers.size()) return too_few_numbers(map, places.size(), numbers.size(), nid_c, first_nid_bg);
  for (size_t i = 0; i < places.size(); ++i) {
    map.balise_groups.push_back({.nid_c = nid_c,
                                 .nid_bg = numbers[i],
                                 .edge = places[i].edge,
                                 .offset_m = places[i].offset_m,
                                 .nominal_is_forward = true,
                                 .is_virtual = true,
                                 .q_locacc_m = q_locacc_m,
                                 .balises = {}});
  }
  VirtualBalises out{.every_m = every_m, .groups = places.size()};
  for (const Edge& edge : map.edges) {
    if (groups_along(edge.alignment.length_m(), every_m) > 0) continue;
    ++out.short_edges;
    out.short_m += edge.alignment.length_m();
  }
  return out;
}

core::Status keep_landmarks(Map& map, const std::vector<std::string>& kinds) {
  for (const auto& kind : kinds) {
    if (landmark_kind_from(kind)) continue;
    return core::Error{"there are no landmarks of kind \"" + kind + "\", only " + landmark_kinds()};
  }
  std::unordered_map<uint32_t, uint32_t> new_ids;
  std::vector<Landmark> kept;
  for (const Landmark& mark : map.landmarks) {
    if (std::ranges::find(kinds, to_string(mark.kind)) == kinds.end()) continue;
    kept.push_back(mark);
    kept.back().id = new_ids[mark.id] = static_cast<uint32_t>(kept.size());
  }
  map.landmarks = std::move(kept);
  for (BaliseGroup& group : map.balise_groups) {
    for (uint32_t& id : group.balises) id = new_ids.contains(id) ? new_ids.at(id) : 0;
  }
  return {};
}

}  // namespace railfix::track
