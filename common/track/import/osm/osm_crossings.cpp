#include "track/import/osm/osm_crossings.hpp"

#include "track/import/told.hpp"

namespace railfix::track {
namespace {

class Crossings {
 public:
  Crossings(const OsmData& data, const std::vector<OsmChain>& chains, Draft& draft, std::vector<std::string>& problems)
      : data_(data), chains_(chains), draft_(draft), problems_(problems) {}

  void judge(size_t node, const std::vector<EdgeEnd>& ends) {
    if (ends.size() != 4 || draft_.nodes[node].is_crossing) return;
    const std::vector<WayOver> ways = ways_over(draft_, node, ends);
    if (ways.size() < 2 || ways[1].diverging) return;
    if (draft_.nodes[node].is_switch) {
      if (value_of(data_.nodes.at(id_of(ends[0])).tags, "railway:switch") == "single_slip")
        single_slips_.push_back(place_of(ends[0]));
    } else if (on_different_layers(ends, ways)) {
      draft_.nodes[node].is_crossing = true;
      tell_layers(ends[ways[0].a], ends[ways[1].a]);
    } else if (ways.size() > 2) {
      unsaid_.push_back(place_of(ends[0]));
    }
  }

  void tell() {
    if (!unsaid_.empty())
      problems_.push_back("slip or crossing? Of " + std::to_string(unsaid_.size()) +
                          " nodes where two tracks meet at 15 degrees or less the source says neither railway=switch "
                          "nor railway=railway_crossing; taken as double slips: " +
                          told_list(unsaid_));
    if (!single_slips_.empty())
      problems_.push_back(std::to_string(single_slips_.size()) +
                          " single slips have both their branches on the map, as double ones: OpenStreetMap does not "
                          "say which of them is there: " +
                          told_list(single_slips_));
  }

 private:
  [[nodiscard]] int64_t id_of(const EdgeEnd& end) const {
    const std::vector<int64_t>& nodes = chains_[end.edge].nodes;
    return end.at_end ? nodes.back() : nodes.front();
  }
  [[nodiscard]] const OsmWay& way_of(const EdgeEnd& end) const {
    const std::vector<size_t>& ways = chains_[end.edge].ways;
    return data_.ways[end.at_end ? ways.back() : ways.front()];
  }
  [[nodiscard]] std::string layer_of(const EdgeEnd& end) const {
    const std::string layer = value_of(way_of(end).tags, "layer");
    return layer.empty() ? "0" : layer;
  }
  [[nodiscard]] std::string place_of(const EdgeEnd& end) const {
    return called(id_of(end), data_.nodes.at(id_of(end)).place, way_of(end).id);
  }

  /// Each track stays on its own: where a bridge begins at a slip, one of them does not.
  [[nodiscard]] bool on_different_layers(const std::vector<EdgeEnd>& ends, const std::vector<WayOver>& ways) const {
    const auto stays = [&](const WayOver& way) { return layer_of(ends[way.a]) == layer_of(ends[way.b]); };
    return stays(ways[0]) && stays(ways[1]) && layer_of(ends[ways[0].a]) != layer_of(ends[ways[1].a]);
  }

  void tell_layers(const EdgeEnd& one, const EdgeEnd& other) {
    const auto told = [&](const EdgeEnd& end) {
      return "way/" + std::to_string(way_of(end).id) + " (layer " + layer_of(end) + ")";
    };
    problems_.push_back(told(one) + " and " + told(other) + " share " + place_of(one) +
                        ", though one leads over the other: no train changes there on the map; take the node out of "
                        "one of them in the source");
  }

  const OsmData& data_;
  const std::vector<OsmChain>& chains_;
  Draft& draft_;
  std::vector<std::string>& problems_;
  std::vector<std::string> unsaid_;
  std::vector<std::string> single_slips_;
};

}  // namespace

void judge_crossings(const OsmData& data, const std::vector<OsmChain>& chains, Draft& draft,
                     std::vector<std::string>& problems) {
  const std::vector<std::vector<EdgeEnd>> ends = ends_at_nodes(draft);
  Crossings crossings(data, chains, draft, problems);
  for (size_t node = 0; node < ends.size(); ++node) crossings.judge(node, ends[node]);
  crossings.tell();
}

}  // namespace railfix::track
