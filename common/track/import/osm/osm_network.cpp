#include "track/import/osm/osm_network.hpp"

#include <algorithm>
#include <cmath>
#include <set>

#include "core/units.hpp"
#include "track/import/fit/biarc.hpp"
#include "track/import/fit/plane.hpp"
#include "track/import/fit/smooth.hpp"
#include "track/import/osm/osm_node_marks.hpp"
#include "track/import/osm/osm_overbridges.hpp"
#include "track/import/osm/osm_stray_nodes.hpp"
#include "track/import/osm/osm_trackside.hpp"
#include "track/import/told.hpp"

namespace railfix::track {
namespace {

constexpr size_t kPointsForSigma = 12;
constexpr double kLeastUsualSigmaM = 0.05;
constexpr double kTangentBranchRad = core::kPi / 6.0;
constexpr size_t kMostNamed = 5;
constexpr const char* kAskForNodes =
    "extract the ways together with their nodes, from Overpass by (._;>;); or by out geom;";

struct Segment {
  int64_t a = 0;
  int64_t b = 0;
  size_t way = 0;
  bool used = false;
};

/// One end of a chain at its node, seen leaving the node.
struct ChainEnd {
  size_t chain = 0;
  bool at_end = false;
  double leaving_rad = 0;
  double first_step_m = 0;
};

class Builder {
 public:
  Builder(const OsmData& data, const Projection& projection, double smooth_m, bool with_clothoids)
      : data_(data),
        projection_(projection),
        overbridges_(data, projection),
        smooth_m_(smooth_m),
        with_clothoids_(with_clothoids) {}

  OsmNetwork build() {
    collect_segments();
    tell_stray_nodes();
    trace_chains();
    find_usual_sigma();
    gather_ends();
    for (const auto& [node, ends] : ends_) agree_on_tangents(ends);
    for (OsmChain& chain : chains_) add_edge(chain);
    add_marks_at_nodes(data_, chains_, out_.draft);
    add_trackside();
    for (std::string& problem : unread_tags(data_)) out_.problems.push_back(std::move(problem));
    return std::move(out_);
  }

 private:
  [[nodiscard]] const OsmTags& tags_at(int64_t node) const { return data_.nodes.at(node).tags; }

  void collect_segments() {
    std::set<std::pair<int64_t, int64_t>> seen;
    size_t missing = 0;
    std::vector<int64_t> lacking;  // ways
    for (size_t way = 0; way < data_.ways.size(); ++way) {
      const size_t missing_before = missing;
      int64_t before = 0;
      bool has_before = false;
      for (const int64_t node : data_.ways[way].nodes) {
        if (!place(node)) {
          ++missing;
          has_before = false;
          continue;
        }
        if (has_before && before != node && seen.insert(std::minmax(before, node)).second &&
            (places_.at(before) - places_.at(node)).norm() > 0.01) {
          at_node_[before].push_back(segments_.size());
          at_node_[node].push_back(segments_.size());
          segments_.push_back({before, node, way});
        }
        before = node;
        has_before = true;
      }
      if (missing > missing_before) lacking.push_back(data_.ways[way].id);
    }
    if (missing > 0) out_.cuts.push_back(told_missing(lacking, missing));
  }

  /// One sentence for all: of a region that is cut out, every way over its border lacks nodes.
  static std::string told_missing(const std::vector<int64_t>& ways, size_t nodes) {
    std::string names;
    const size_t named = std::min(kMostNamed, ways.size());
    for (size_t i = 0; i < named; ++i) names += (i == 0 ? "way " : ", way ") + std::to_string(ways[i]);
    if (ways.size() > named) names += " and " + std::to_string(ways.size() - named) + " more ways";
    return names + (ways.size() == 1 ? " names " : " name ") + std::to_string(nodes) +
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
    for (size_t i = 0; i < std::min(kMostNamed, stray.size()); ++i) {
      const auto& [node, off_m] = stray[i];
      const GeoPoint& at = data_.nodes.at(node).place;
      out_.cuts.push_back((node == id_of_place(at) ? "the point" : "node " + std::to_string(node)) + " of way/" +
                          std::to_string(data_.ways[segments_[at_node_.at(node).front()].way].id) + " at latitude " +
                          told_number(at.lat_deg, 6) + ", longitude " + told_number(at.lon_deg, 6) + " lies " +
                          told_m(off_m) +
                          " off the line between its neighbours, as no track runs: correct its place in the source, or "
                          "take it out of the way");
    }
    if (stray.size() > kMostNamed)
      out_.cuts.push_back(std::to_string(stray.size() - kMostNamed) + " more nodes lie up to " +
                          told_m(stray[kMostNamed].off_m) + " off the line between their neighbours");
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
    const std::string kind = value_of(tags_at(node), "railway");
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
          if (!segments_[i].used && (rings || is_break(begin))) trace(begin, i);
        }
      }
    }
  }

  void trace(int64_t begin, size_t segment) {
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
    chains_.push_back(std::move(chain));
  }

  /// Tracks of many points tell how well this region is drawn.
  void find_usual_sigma() {
    std::vector<double> scatters;
    for (const OsmChain& chain : chains_) {
      const std::vector<Eigen::Vector2d> points = thinned(chain.points);
      if (points.size() >= kPointsForSigma) scatters.push_back(scatter_of(points));
    }
    if (scatters.empty()) return;
    const auto middle = scatters.begin() + static_cast<ptrdiff_t>(scatters.size() / 2);
    std::nth_element(scatters.begin(), middle, scatters.end());
    usual_sigma_m_ = std::max(*middle, kLeastUsualSigmaM);
  }

  void gather_ends() {
    for (size_t i = 0; i < chains_.size(); ++i) {
      const std::vector<Eigen::Vector2d>& kept = chains_[i].shape;
      const Eigen::Vector2d first = kept[1] - kept[0];
      const Eigen::Vector2d last = kept[kept.size() - 2] - kept.back();
      double leaving_first = heading_of(first);
      double leaving_last = heading_of(last);
      if (const std::optional<ClothoidFit> fit = clothoids(chains_[i])) {
        // The whole track tells its direction better than its last two points do.
        leaving_first = fit->alignment.at(0).pose.heading_rad;
        leaving_last = fit->alignment.at(fit->alignment.length_m()).pose.heading_rad + core::kPi;
      }
      ends_[chains_[i].nodes.front()].push_back({i, false, leaving_first, first.norm()});
      ends_[chains_[i].nodes.back()].push_back({i, true, leaving_last, last.norm()});
    }
  }

  [[nodiscard]] std::optional<ClothoidFit> clothoids(const OsmChain& chain) const {
    if (!with_clothoids_) return std::nullopt;
    return fit_drawing(thinned(chain.points), {chain.heading_at_start, chain.heading_at_end, 0, usual_sigma_m_});
  }

  void set_leaving(const ChainEnd& end, double leaving_rad) {
    OsmChain& chain = chains_[end.chain];
    (end.at_end ? chain.heading_at_end : chain.heading_at_start) = leaving_rad + (end.at_end ? core::kPi : 0.0);
  }

  /// The two ends that run on most straightly share the tangent of the circle through the node and its neighbours; a
  /// branch leaves along it too, as a turnout does.
  void agree_on_tangents(const std::vector<ChainEnd>& ends) {
    struct Pair {
      size_t a, b;
      double turn_rad;
    };
    std::vector<Pair> pairs;
    for (size_t a = 0; a < ends.size(); ++a) {
      for (size_t b = a + 1; b < ends.size(); ++b) {
        const double turn = core::wrap_pi(ends[b].leaving_rad - ends[a].leaving_rad - core::kPi);
        if (std::abs(turn) < kSharpestTurnRad) pairs.push_back({a, b, turn});
      }
    }
    std::sort(pairs.begin(), pairs.end(),
              [](const Pair& x, const Pair& y) { return std::abs(x.turn_rad) < std::abs(y.turn_rad); });
    std::vector<std::optional<double>> leaving(ends.size());
    for (const auto& [a, b, turn] : pairs) {
      if (!leaving[a] && !leaving[b]) {
        const double part = ends[a].first_step_m / (ends[a].first_step_m + ends[b].first_step_m);
        leaving[b] = ends[a].leaving_rad + core::kPi + turn * part;
        leaving[a] = *leaving[b] + core::kPi;
      } else if (std::abs(turn) < kTangentBranchRad) {
        if (!leaving[a]) leaving[a] = *leaving[b] + core::kPi;
        if (!leaving[b]) leaving[b] = *leaving[a] + core::kPi;
      }
    }
    for (size_t i = 0; i < ends.size(); ++i) {
      if (leaving[i]) set_leaving(ends[i], *leaving[i]);
    }
  }

  size_t node_index(int64_t node) {
    const auto [entry, is_new] = node_index_.try_emplace(node, out_.draft.nodes.size());
    if (is_new) {
      const OsmTags& tags = tags_at(node);
      const std::string kind = value_of(tags, "railway");
      const std::string ref = value_of(tags, "ref");
      const Eigen::Vector2d& at = places_.at(node);
      out_.draft.nodes.push_back({ref, at.x(), at.y(), kind == "switch", kind == "railway_crossing"});
    }
    return entry->second;
  }

  void add_edge(OsmChain& chain) {
    const std::optional<ClothoidFit> smooth = clothoids(chain);
    PolylineFit fit;
    if (smooth) {
      fit.alignment = smooth->alignment;
    } else {
      fit = fit_polyline(chain.shape, chain.heading_at_start, chain.heading_at_end);
      if (with_clothoids_) ++(chain.shape.size() == 2 ? out_.fit.two_points : out_.fit.left_as_arcs);
    }
    const OsmWay& way = data_.ways[chain.ways.front()];
    const size_t number = ++pieces_[way.id];
    DraftEdge edge;
    edge.track.name = "way/" + std::to_string(way.id) + (number > 1 ? "#" + std::to_string(number) : "");
    edge.track.line = line_of(chain);
    if (smooth) {
      out_.fit.add(edge.track.name, *smooth, chain.points.size());
      tell_left_out(edge.track.name, *smooth);
    }
    edge.track.alignment = std::move(fit.alignment);
    OsmMarks(data_, chain).add(edge.track);
    overbridges_.add(data_, chain, edge.track);
    if (fit.straightened > 0) {
      out_.problems.push_back("edge " + edge.track.name + " has " + std::to_string(fit.straightened) +
                              " stretches with points too crooked for a track; they are straight lines now");
    }
    edge.from_node = node_index(chain.nodes.front());
    edge.to_node = node_index(chain.nodes.back());
    const std::vector<Eigen::Vector2d>& kept = chain.shape;
    edge.leaving_from_rad = heading_of(kept[1] - kept[0]);
    edge.leaving_to_rad = heading_of(kept[kept.size() - 2] - kept.back());
    out_.figures.include(fit.figures);
    for (const Eigen::Vector2d& point : chain.points) {
      const double distance = std::abs(edge.track.alignment.nearest(point.x(), point.y()).lateral_m);
      out_.figures.max_point_distance_m = std::max(out_.figures.max_point_distance_m, distance);
    }
    out_.draft.edges.push_back(std::move(edge));
  }

  void add_trackside() {
    OsmTrackside trackside(data_, projection_, chains_, out_.draft);
    const auto tell = [&](size_t count, const std::string& of) {
      if (count > 0) out_.problems.push_back(std::to_string(count) + " of " + of + " beside no track; left out");
    };
    tell(trackside.add_platforms(), std::to_string(data_.platforms.size()) + " platforms lie");
    tell(trackside.add_masts(), "the catenary masts stand");
    const auto stops = std::count_if(data_.nodes.begin(), data_.nodes.end(), [](const auto& entry) {
      const OsmTags& tags = entry.second.tags;
      return value_of(tags, "railway") == "stop" || value_of(tags, "public_transport") == "stop_position";
    });
    // Where trains stop, there is something to see, but the point on the track does not tell from where to where.
    if (stops > 0 && data_.platforms.empty()) {
      out_.problems.push_back("the data hold " + std::to_string(stops) +
                              " stop positions and no platform; an extract with railway=platform and platform_edge "
                              "would have their ends as references");
    }
  }

  void tell_left_out(const std::string& track, const ClothoidFit& fit) {
    if (fit.left_out == 0) return;
    out_.problems.push_back("edge " + track + " has " + told_left_out(fit.left_out, fit.left_out_max_m));
  }

  /// The name (else the number) of the way with most segments of the chain.
  [[nodiscard]] std::string line_of(const OsmChain& chain) const {
    std::map<std::string, size_t> votes;
    for (const size_t way : chain.ways) {
      const OsmTags& tags = data_.ways[way].tags;
      const std::string name = value_of(tags, "name");
      ++votes[name.empty() ? value_of(tags, "ref") : name];
    }
    return std::max_element(votes.begin(), votes.end(),
                            [](const auto& a, const auto& b) { return a.second < b.second; })
        ->first;
  }

  const OsmData& data_;
  const Projection& projection_;
  OsmOverbridges overbridges_;
  double smooth_m_;
  bool with_clothoids_;
  double usual_sigma_m_ = 0.3;
  std::vector<Segment> segments_;
  std::unordered_map<int64_t, std::vector<size_t>> at_node_;
  OsmPlaces places_;
  std::vector<OsmChain> chains_;
  std::map<int64_t, std::vector<ChainEnd>> ends_;
  std::unordered_map<int64_t, size_t> node_index_;
  std::unordered_map<int64_t, size_t> pieces_;
  OsmNetwork out_;
};

}  // namespace

core::Result<OsmNetwork> build_osm_network(const OsmData& data, const Projection& projection, double smooth_m,
                                           bool with_clothoids) {
  OsmNetwork network = Builder(data, projection, smooth_m, with_clothoids).build();
  if (network.draft.edges.empty()) {
    if (!data.ways.empty())
      return core::Error{"none of the " + std::to_string(data.ways.size()) +
                         " railway tracks has a length: the points of each are at one place, or where the map's "
                         "coordinates do not reach"};
    return core::Error{
        "the data hold no railway tracks (railway=rail, light_rail, narrow_gauge or subway; --trams adds trams)"};
  }
  return network;
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

std::optional<GeoPoint> middle_of(const OsmData& data) {
  double south = 90;
  double north = -90;
  double west = 180;
  double east = -180;
  for (const OsmWay& way : data.ways) {
    for (const int64_t id : way.nodes) {
      const auto node = data.nodes.find(id);
      if (node == data.nodes.end()) continue;
      south = std::min(south, node->second.place.lat_deg);
      north = std::max(north, node->second.place.lat_deg);
      west = std::min(west, node->second.place.lon_deg);
      east = std::max(east, node->second.place.lon_deg);
    }
  }
  if (south > north) return std::nullopt;
  return GeoPoint{0.5 * (south + north), 0.5 * (west + east)};
}

}  // namespace railfix::track
