#include "track/import/osm/osm_network.hpp"

#include <algorithm>
#include <cmath>

#include "core/units.hpp"
#include "track/import/fit/biarc.hpp"
#include "track/import/fit/plane.hpp"
#include "track/import/osm/osm_chains.hpp"
#include "track/import/osm/osm_crossings.hpp"
#include "track/import/osm/osm_heights.hpp"
#include "track/import/osm/osm_node_marks.hpp"
#include "track/import/osm/osm_onward.hpp"
#include "track/import/osm/osm_overbridges.hpp"
#include "track/import/osm/osm_trackside.hpp"
#include "track/import/told.hpp"

namespace railfix::track {
namespace {

constexpr size_t kPointsForSigma = 12;
constexpr double kLeastUsualSigmaM = 0.05;
constexpr double kTangentBranchRad = core::kPi / 6.0;

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
        points_(data),
        with_clothoids_(with_clothoids) {
    OsmChains traced = chains_of(data, projection, smooth_m);
    chains_ = std::move(traced.chains);
    places_ = std::move(traced.places);
    out_.cuts = std::move(traced.cuts);
    out_.problems = std::move(traced.problems);
  }

  OsmNetwork build() {
    find_usual_sigma();
    gather_ends();
    for (const auto& [node, ends] : ends_) agree_on_tangents(ends);
    const OsmOnward onward(data_, chains_);
    for (const OsmChain& chain : chains_) add_edge(chain, onward);
    judge_crossings(data_, chains_, out_.draft, out_.problems);
    add_heights(data_, chains_, out_.draft, out_.problems);
    add_marks_at_nodes(data_, chains_, out_.draft, points_);
    add_trackside();
    points_.tell(out_.problems);
    for (std::string& problem : unread_tags(data_)) out_.problems.push_back(std::move(problem));
    return std::move(out_);
  }

 private:
  [[nodiscard]] const OsmTags& tags_at(int64_t node) const { return data_.nodes.at(node).tags; }

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

  void add_edge(const OsmChain& chain, const OsmOnward& onward) {
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
    OsmMarks(data_, chain, points_).add(edge.track);
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
    edge.onward_from = onward.of(chain, false);
    edge.onward_to = onward.of(chain, true);
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

  /// That of the ways with most segments of the chain.
  [[nodiscard]] std::string line_of(const OsmChain& chain) const {
    std::map<std::string, size_t> votes;
    for (const size_t way : chain.ways) ++votes[line_in(data_.ways[way].tags)];
    return std::max_element(votes.begin(), votes.end(),
                            [](const auto& a, const auto& b) { return a.second < b.second; })
        ->first;
  }

  const OsmData& data_;
  const Projection& projection_;
  OsmOverbridges overbridges_;
  OsmPoints points_;
  bool with_clothoids_;
  double usual_sigma_m_ = 0.3;
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
