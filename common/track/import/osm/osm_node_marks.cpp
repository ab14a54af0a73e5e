#include "track/import/osm/osm_node_marks.hpp"

#include <algorithm>
#include <set>

namespace railfix::track {
namespace {

class NodeMarks {
 public:
  NodeMarks(const OsmData& data, const std::vector<OsmChain>& chains, Draft& draft, OsmPoints& points)
      : data_(data), chains_(chains), draft_(draft), points_(points) {}

  void add(size_t node, const std::vector<EdgeEnd>& ends) {
    const std::vector<WayOver> ways = ways_over(draft_, node, ends);
    add_portals(ends, ways);
    add_point(ends, ways);
  }

 private:
  [[nodiscard]] const OsmTags& tags_of(const EdgeEnd& end) const {
    const std::vector<size_t>& ways = chains_[end.edge].ways;
    return data_.ways[end.at_end ? ways.back() : ways.front()].tags;
  }
  [[nodiscard]] bool in_tunnel(const EdgeEnd& end) const { return is_set(tags_of(end), "tunnel"); }
  [[nodiscard]] double offset_of(const EdgeEnd& end) const {
    return end.at_end ? draft_.edges[end.edge].track.alignment.length_m() : 0.0;
  }

  /// A portal is on the track in the tunnel, unless that goes on in the tunnel over another leg of the switch: then it
  /// is on the leg that leaves it. So every way over the node meets it once.
  void add_portals(const std::vector<EdgeEnd>& ends, const std::vector<WayOver>& ways) {
    const auto goes_on = [&](size_t inside) {
      return std::any_of(ways.begin(), ways.end(), [&](const WayOver& way) {
        return (way.a == inside && in_tunnel(ends[way.b])) || (way.b == inside && in_tunnel(ends[way.a]));
      });
    };
    std::set<size_t> has_portal;
    for (const WayOver& way : ways) {
      if (in_tunnel(ends[way.a]) == in_tunnel(ends[way.b])) continue;
      const size_t inside = in_tunnel(ends[way.a]) ? way.a : way.b;
      const size_t outside = inside == way.a ? way.b : way.a;
      const size_t at = goes_on(inside) ? outside : inside;
      if (!has_portal.insert(at).second) continue;
      const EdgeEnd& end = ends[at];
      const bool enters = (at == inside) != end.at_end;
      draft_.edges[end.edge].track.marks.push_back({enters ? LandmarkKind::portal_in : LandmarkKind::portal_out,
                                                    offset_of(end), 0, kMappingSigmaM,
                                                    value_of(tags_of(ends[inside]), "tunnel:name")});
    }
  }

  /// On the edge that most ways over the node share.
  void add_point(const std::vector<EdgeEnd>& ends, const std::vector<WayOver>& ways) {
    if (ends.empty()) return;
    std::vector<size_t> shared(ends.size(), 0);
    for (const WayOver& way : ways) {
      ++shared[way.a];
      ++shared[way.b];
    }
    const auto on = static_cast<size_t>(std::max_element(shared.begin(), shared.end()) - shared.begin());
    const EdgeEnd& end = ends[on];
    const OsmChain& chain = chains_[end.edge];
    auto mark = points_.mark(end.at_end ? chain.nodes.back() : chain.nodes.front(),
                             data_.ways[end.at_end ? chain.ways.back() : chain.ways.front()].id, offset_of(end),
                             along_way(on, ends, ways));
    if (mark) draft_.edges[end.edge].track.marks.push_back(std::move(*mark));
  }

  /// Whether the edge runs as its way is drawn there, where all that a train runs on to are drawn in one direction.
  [[nodiscard]] std::optional<bool> along_way(size_t on, const std::vector<EdgeEnd>& ends,
                                              const std::vector<WayOver>& ways) const {
    const bool is_turned = std::any_of(ways.begin(), ways.end(), [&](const WayOver& way) {
      return (way.a == on || way.b == on) && leads_here(ends[way.a]) == leads_here(ends[way.b]);
    });
    return is_turned ? std::nullopt : std::optional(leads_here(ends[on]) == ends[on].at_end);
  }
  /// Is the way drawn towards the node?
  [[nodiscard]] bool leads_here(const EdgeEnd& end) const {
    const std::vector<bool>& along = chains_[end.edge].along_way;
    return (end.at_end ? along.back() : along.front()) == end.at_end;
  }

  const OsmData& data_;
  const std::vector<OsmChain>& chains_;
  Draft& draft_;
  OsmPoints& points_;
};

}  // namespace

void add_marks_at_nodes(const OsmData& data, const std::vector<OsmChain>& chains, Draft& draft, OsmPoints& points) {
  const std::vector<std::vector<EdgeEnd>> ends = ends_at_nodes(draft);
  NodeMarks marks(data, chains, draft, points);
  for (size_t node = 0; node < ends.size(); ++node) marks.add(node, ends[node]);
}

}  // namespace railfix::track
