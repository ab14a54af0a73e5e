#include "track/import/osm/osm_node_marks.hpp"

#include <algorithm>
#include <set>

namespace railfix::track {
namespace {

class NodeMarks {
 public:
  NodeMarks(const OsmData& data, const std::vector<OsmChain>& chains, Draft& draft)
      : data_(data), chains_(chains), draft_(draft) {}

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
    const EdgeEnd& end = ends[static_cast<size_t>(std::max_element(shared.begin(), shared.end()) - shared.begin())];
    const std::vector<int64_t>& nodes = chains_[end.edge].nodes;
    const OsmTags& tags = data_.nodes.at(end.at_end ? nodes.back() : nodes.front()).tags;
    if (auto mark = point_mark(tags, offset_of(end))) draft_.edges[end.edge].track.marks.push_back(std::move(*mark));
  }

  const OsmData& data_;
  const std::vector<OsmChain>& chains_;
  Draft& draft_;
};

}  // namespace

void add_marks_at_nodes(const OsmData& data, const std::vector<OsmChain>& chains, Draft& draft) {
  const std::vector<std::vector<EdgeEnd>> ends = ends_at_nodes(draft);
  NodeMarks marks(data, chains, draft);
  for (size_t node = 0; node < ends.size(); ++node) marks.add(node, ends[node]);
}

}  // namespace railfix::track
