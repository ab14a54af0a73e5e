#include "track/import/finish.hpp"

#include <algorithm>
#include <cmath>
#include <optional>
#include <set>
#include <span>
#include <unordered_map>

#include "track/frog.hpp"
#include "track/import/told.hpp"

namespace railfix::track {
namespace {

// A reference so near to another one adds nothing, and says less well where it is than a real group does.
constexpr double kNearGroupM = 10.0;

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
  bool nominal_is_forward = true;
};

uint32_t groups_along(double length_m, double every_m) {
  return static_cast<uint32_t>(std::lround(length_m / every_m));
}

/// Where groups are already.
class TakenPlaces {
 public:
  explicit TakenPlaces(const Map& map) {
    for (const BaliseGroup& group : map.balise_groups) taken_.emplace(group.edge, group.offset_m);
  }
  void take(const VirtualPlace& place) { taken_.emplace(place.edge, place.offset_m); }
  [[nodiscard]] bool is_near(const VirtualPlace& place) const {
    const auto next = taken_.lower_bound({place.edge, place.offset_m - kNearGroupM});
    return next != taken_.end() && next->first == place.edge && next->second <= place.offset_m + kNearGroupM;
  }

 private:
  std::set<std::pair<uint32_t, double>> taken_;
};

/// Evenly along every edge, but for places that have a group already.
std::vector<VirtualPlace> virtual_places(const Map& map, double every_m) {
  const TakenPlaces taken(map);
  std::vector<VirtualPlace> out;
  for (const Edge& edge : map.edges) {
    const double length_m = edge.alignment.length_m();
    const uint32_t count = groups_along(length_m, every_m);
    for (uint32_t i = 0; i < count; ++i) {
      const VirtualPlace place{edge.id, length_m * (i + 0.5) / count};
      if (!taken.is_near(place)) out.push_back(place);
    }
  }
  return out;
}

struct GroupName {
  uint32_t nid_c = 0;
  uint32_t nid_bg = 0;
  auto operator<=>(const GroupName&) const = default;
};

/// Those that a group of the map has already are left to it.
std::vector<GroupName> free_names(const Map& map, const GroupNumbers& numbers) {
  std::set<GroupName> taken;
  for (const BaliseGroup& group : map.balise_groups) taken.insert({group.nid_c, group.nid_bg});
  std::vector<GroupName> out;
  for (const uint32_t nid_c : numbers.nid_c) {
    const bool is_first = nid_c == numbers.nid_c.front();
    for (uint32_t nid_bg = is_first ? numbers.first_nid_bg : 1; nid_bg <= BaliseGroup::kLastNidBg; ++nid_bg) {
      if (taken.insert({nid_c, nid_bg}).second) out.push_back({nid_c, nid_bg});
    }
  }
  return out;
}

core::Error too_few_names(size_t places, size_t names, const GroupNumbers& numbers) {
  std::string list;
  for (const uint32_t nid_c : numbers.nid_c) list += (list.empty() ? "" : ", ") + std::to_string(nid_c);
  return {std::to_string(places) + " virtual balise groups are more than NID_C " + list +
          " has numbers for: " + std::to_string(names) + " are free from " + std::to_string(numbers.first_nid_bg) +
          " on; begin at a lower NID_BG, give one more NID_C (as in --nid-c 85,86) or place fewer"};
}

/// None where they are more than there are names.
core::Status put_groups(Map& map, const std::vector<VirtualPlace>& places, const GroupNumbers& numbers,
                        double q_locacc_m) {
  const auto is_none = [](uint32_t nid_c) { return nid_c > BaliseGroup::kLastNidC; };
  if (numbers.nid_c.empty() || std::ranges::any_of(numbers.nid_c, is_none))
    return core::Error{"NID_C must be between 0 and 1023"};
  const std::vector<GroupName> names = free_names(map, numbers);
  if (names.size() < places.size()) return too_few_names(places.size(), names.size(), numbers);
  for (size_t i = 0; i < places.size(); ++i) {
    map.balise_groups.push_back({.nid_c = names[i].nid_c,
                                 .nid_bg = names[i].nid_bg,
                                 .edge = places[i].edge,
                                 .offset_m = places[i].offset_m,
                                 .nominal_is_forward = places[i].nominal_is_forward,
                                 .is_virtual = true,
                                 .q_locacc_m = q_locacc_m,
                                 .balises = {}});
  }
  return {};
}

}  // namespace

void add_frogs(Map& map, double sigma_m, size_t first) {
  std::unordered_map<uint32_t, std::vector<Connection>> ways_at;
  for (const Connection& way : map.connections) ways_at[way.node].push_back(way);
  for (const Node& node : std::span(map.nodes).subspan(first)) {
    const std::vector<Connection>& ways = ways_at[node.id];
    for (const Connection& way : ways) {
      for (const Connection& straight : ways) {
        if (way.diverging && !straight.diverging) add_frogs_of(map, node, straight, way, sigma_m);
      }
    }
  }
}

core::Result<VirtualBalises> add_virtual_balises(Map& map, double every_m, const GroupNumbers& numbers,
                                                 double q_locacc_m) {
  if (!(every_m >= 1.0)) return core::Error{"virtual balise groups must be at least 1 m apart"};
  const std::vector<VirtualPlace> places = virtual_places(map, every_m);
  const core::Status put = put_groups(map, places, numbers, q_locacc_m);
  if (!put.ok()) return put.error();
  VirtualBalises out{.every_m = every_m, .groups = places.size()};
  for (const Edge& edge : map.edges) {
    if (groups_along(edge.alignment.length_m(), every_m) > 0) continue;
    ++out.short_edges;
    out.short_m += edge.alignment.length_m();
  }
  return out;
}

core::Status add_virtual_balises_at(Map& map, const std::vector<std::string>& places, const GroupNumbers& numbers,
                                    double q_locacc_m) {
  TakenPlaces taken(map);
  std::vector<VirtualPlace> put;
  for (const std::string& text : places) {
    const auto position = map.parse_position(text);
    if (!position.ok()) return position.error();
    const EdgePosition& at = position.value();
    put.push_back({at.edge, at.offset_m, at.direction != Direction::reverse});
    if (taken.is_near(put.back()))
      return core::Error{"a balise group is within " + told_m(kNearGroupM, 0) + " of " + text + " already"};
    taken.take(put.back());
  }
  return put_groups(map, put, numbers, q_locacc_m);
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
