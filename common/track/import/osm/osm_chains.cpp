#include "track/import/osm/osm_chains.hpp"

#include <algorithm>
#include <cmath>
#include <optional>
#include <set>

#include "core/units.hpp"
#include "track/import/fit/biarc.hpp"
#include "track/import/fit/plane.hpp"
#include "track/import/fit/smooth.hpp"
#include "track/import/network.hpp"
#include "track/import/told.hpp"

namespace railfix::track {
namespace {

constexpr size_t kMostStraysNamed = 5;
constexpr double kApartM = 0.01;
constexpr const char* kAskForNodes =
    "extract the ways together with their nodes, from Overpass by (._;>;); or by out geom;";

struct Segment {
  int64_t a = 0;
  int64_t b = 0;
  size_t way = 0;
  bool used = false;
};

class Tracer {
 public:
  Tracer(const OsmData& data, const Projection& projection, double smooth_m)
      : data_(data), projection_(projection), smooth_m_(smooth_m) {}

  OsmChains trace() {
    collect_segments();
    tell_stray_nodes();
    trace_chains();
    out_.places = std::move(places_);
    return std::move(out_);
  }

 private:
  void collect_segments() {
    size_t missing = 0;
    std::vector<std::string> lacking;
    std::vector<std::string> shapeless;
    for (size_t way = 0; way < data_.ways.size(); ++way) {
      const auto of_way = collect_segments(way);
      missing += of_way.missing;
      if (of_way.missing > 0) {
        lacking.push_back("way " + std::to_string(data_.ways[way].id));
      } else if (!of_way.has_length) {
        shapeless.push_back("way " + std::to_string(data_.ways[way].id));
      }
    }
    if (!shapeless.empty())
      out_.cuts.push_back(std::to_string(shapeless.size()) +
                          " railway ways have no two points apart from each other; left out: " +
                          told_list(shapeless, kMostStraysNamed));
    if (missing > 0) out_.cuts.push_back(told_missing(lacking, missing));
  }

  struct WayNodes {
    size_t missing = 0;  // nodes that the data do not hold
    bool has_length = false;
  };
  WayNodes collect_segments(size_t way) {
    WayNodes nodes;
    std::optional<int64_t> before;
    for (const int64_t node : data_.ways[way].nodes) {
      if (!place(node)) {
        ++nodes.missing;
        before.reset();
        continue;
      }
      const bool are_apart = before && (places_.at(*before) - places_.at(node)).norm() > kApartM;
      nodes.has_length = nodes.has_length || are_apart;
      if (are_apart && met_.insert(std::minmax(*before, node)).second) {
        at_node_[*before].push_back(segments_.size());
        at_node_[node].push_back(segments_.size());
        segments_.push_back({*before, node, way});
      }
      before = node;
    }
    return nodes;
  }

  /// One sentence for all: of a region that is cut out, every way over its border lacks nodes.
  static std::string told_missing(const std::vector<std::string>& ways, size_t nodes) {
    return told_list(ways, kMostStraysNamed) + (ways.size() == 1 ? " names " : " name ") + std::to_string(nodes) +
           (nodes == 1 ? " node" : " nodes") +
           " that the data do not hold; the tracks have gaps there: " + kAskForNodes;
  }

  /// They stay where they are: nobody but the source knows where they belong.
  void tell_stray_nodes() {
    OsmNeighbours neighbours;
    for (const auto& [node, segments] : at_node_) {
      for (const size_t segment : segments) neighbours[node].push_back(other_end(segment, node));
    }
    const std::vector<StrayNode> stray = stray_nodes(places_, neighbours);
    for (size_t i = 0; i < std::min(kMostStraysNamed, stray.size()); ++i) {
      const auto& [node, off_m] = stray[i];
      const int64_t way = data_.ways[segments_[at_node_.at(node).front()].way].id;
      out_.cuts.push_back(called(node, data_.nodes.at(node).place, way) + " lies " + told_m(off_m) +
                          " off the line between its neighbours, as no track runs: correct its place in the source, or "
                          "take it out of the way");
    }
    if (stray.size() > kMostStraysNamed)
      out_.cuts.push_back(std::to_string(stray.size() - kMostStraysNamed) + " more nodes lie up to " +
                          told_m(stray[kMostStraysNamed].off_m) + " off the line between their neighbours");
  }

  bool place(int64_t node) {
    if (places_.contains(node)) return true;
    const auto found = data_.nodes.find(node);
    if (found == data_.nodes.end()) return false;
    const auto point = projection_.from_geo(found->second.place);
    if (!point) return false;
    places_[node] = *point;
    return true;
  }

  [[nodiscard]] bool is_break(int64_t node) const {
    const std::vector<size_t>& segments = at_node_.at(node);
    if (segments.size() != 2) return true;
    const std::string kind = value_of(data_.nodes.at(node).tags, "railway");
    if (kind == "switch" || kind == "railway_crossing") return true;
    const double turn = heading_from(node, segments[0]) - heading_from(node, segments[1]) - core::kPi;
    return std::abs(core::wrap_pi(turn)) > kSharpestTurnRad;
  }
  [[nodiscard]] int64_t other_end(size_t segment, int64_t node) const {
    return segments_[segment].a == node ? segments_[segment].b : segments_[segment].a;
  }
  [[nodiscard]] double heading_from(int64_t node, size_t segment) const {
    return heading_of(places_.at(other_end(segment, node)) - places_.at(node));
  }

  void trace_chains() {
    for (const bool rings : {false, true}) {
      // In the order of the file, so that the same file always gives the same map.
      for (size_t i = 0; i < segments_.size(); ++i) {
        for (const int64_t begin : {segments_[i].a, segments_[i].b}) {
          if (!segments_[i].used && (rings || is_break(begin))) trace_from(begin, i);
        }
      }
    }
  }

  void trace_from(int64_t begin, size_t segment) {
    OsmChain chain;
    chain.nodes.push_back(begin);
    while (true) {
      segments_[segment].used = true;
      chain.ways.push_back(segments_[segment].way);
      chain.along_way.push_back(segments_[segment].a == chain.nodes.back());
      chain.nodes.push_back(other_end(segment, chain.nodes.back()));
      const int64_t here = chain.nodes.back();
      if (here == begin || is_break(here)) break;
      const std::vector<size_t>& next = at_node_.at(here);
      segment = next[0] == segment ? next[1] : next[0];
    }
    for (const int64_t node : chain.nodes) chain.points.push_back(places_.at(node));
    chain.shape = smoothed(thinned(chain.points), smooth_m_);
    if (chain.shape.size() == 2 && (chain.shape[1] - chain.shape[0]).norm() < 0.1) {
      out_.problems.push_back("way " + std::to_string(data_.ways[chain.ways.front()].id) +
                              " has a piece without length; it is left out");
      return;
    }
    out_.chains.push_back(std::move(chain));
  }

  const OsmData& data_;
  const Projection& projection_;
  double smooth_m_;
  std::vector<Segment> segments_;
  std::set<std::pair<int64_t, int64_t>> met_;  // nodes that a segment joins, once
  std::unordered_map<int64_t, std::vector<size_t>> at_node_;
  OsmPlaces places_;
  OsmChains out_;
};

}  // namespace

std::string called(int64_t node, const GeoPoint& at, int64_t way) {
  return (node == id_of_place(at) ? "the point" : "node " + std::to_string(node)) + " of way/" + std::to_string(way) +
         " at " + told_place(at);
}

OsmChains chains_of(const OsmData& data, const Projection& projection, double smooth_m) {
  return Tracer(data, projection, smooth_m).trace();
}

std::string lack_of_nodes(const OsmData& data) {
  const auto held = [&](const OsmWay& way) {
    return std::count_if(way.nodes.begin(), way.nodes.end(), [&](int64_t id) { return data.nodes.contains(id); });
  };
  if (data.ways.empty() || std::any_of(data.ways.begin(), data.ways.end(), [&](const auto& w) { return held(w) > 1; }))
    return "";
  const OsmWay& first = data.ways.front();
  if (std::ranges::all_of(data.ways, [](const OsmWay& way) { return way.nodes.size() < 2; })) {
    return "no railway track has two points (" +
           (first.id > 0 ? "way " + std::to_string(first.id) : std::string("the first track")) + " has " +
           std::to_string(first.nodes.size()) + " on the earth); a line needs two or more";
  }
  return "no railway track has two of its nodes in the data (of way " + std::to_string(first.id) + " they hold " +
         std::to_string(held(first)) + " of " + std::to_string(first.nodes.size()) + "); " + kAskForNodes;
}

}  // namespace railfix::track
