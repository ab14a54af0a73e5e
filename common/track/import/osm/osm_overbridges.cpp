#include "track/import/osm/osm_overbridges.hpp"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <set>

#include "track/import/fit/plane.hpp"
#include "track/import/osm/osm_cells.hpp"

namespace railfix::track {
namespace {

constexpr double kUsualWidthM = 12;  // of a road with its walls
constexpr double kOneBridgeM = 15;   // a road and its footway lie on one
constexpr double kLeastSine = 0.2;   // flatter crossings are no narrower than this makes them

}  // namespace

int layer_of(const OsmTags& tags) {
  const std::string text = value_of(tags, "layer");
  int layer = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), layer);
  if (error == std::errc() && end == text.data() + text.size()) return layer;
  if (is_set(tags, "bridge")) return 1;
  return is_set(tags, "tunnel") ? -1 : 0;
}

OsmOverbridges::OsmOverbridges(const OsmData& data, const Projection& projection) {
  for (const OsmWay& way : data.bridges) take(way, data, projection);
  for (const OsmWay& way : data.ways) {
    if (is_set(way.tags, "bridge")) take(way, data, projection);
  }
}

void OsmOverbridges::take(const OsmWay& way, const OsmData& data, const Projection& projection) {
  const auto place = [&](int64_t node) -> std::optional<Eigen::Vector2d> {
    const auto found = data.nodes.find(node);
    return found == data.nodes.end() ? std::nullopt : projection.from_geo(found->second.place);
  };
  for (size_t i = 1; i < way.nodes.size(); ++i) {
    const auto a = place(way.nodes[i - 1]);
    const auto b = place(way.nodes[i]);
    if (!a || !b || !((*a - *b).norm() < kLongestSegmentM)) continue;
    for_cells(a->cwiseMin(*b), a->cwiseMax(*b), [&](int64_t cell) { in_cell_[cell].push_back(segments_.size()); });
    segments_.push_back({*a, *b, way.nodes[i - 1], way.nodes[i], layer_of(way.tags), &way.tags});
  }
}

std::vector<OsmOverbridges::Crossing> OsmOverbridges::crossings(const OsmData& data, const OsmChain& chain,
                                                                const ImportedTrack& track) const {
  std::vector<Crossing> found;
  for (size_t i = 0; i < chain.ways.size(); ++i) {
    const OsmTags& tags = data.ways[chain.ways[i]].tags;
    if (is_set(tags, "tunnel")) continue;  // nobody sees from in there what crosses above
    const Eigen::Vector2d& a = chain.points[i];
    const Eigen::Vector2d& b = chain.points[i + 1];
    const Eigen::Vector2d along = b - a;
    if (!(along.norm() < kLongestSegmentM)) continue;
    std::set<size_t> near;
    for_cells(a.cwiseMin(b), a.cwiseMax(b), [&](int64_t cell) {
      const auto in = in_cell_.find(cell);
      if (in != in_cell_.end()) near.insert(in->second.begin(), in->second.end());
    });
    const std::set<int64_t> ends{chain.nodes[i], chain.nodes[i + 1]};
    for (const size_t number : near) {
      const Segment& over = segments_[number];
      // What shares a node with the track is joined to it and does not cross it.
      if (over.layer <= layer_of(tags) || ends.contains(over.node_a) || ends.contains(over.node_b)) continue;
      const Eigen::Vector2d across = over.b - over.a;
      const double turn = cross(along, across);
      const double on_track = cross(over.a - a, across) / turn;
      const double on_bridge = cross(over.a - a, along) / turn;
      if (!(on_track >= 0 && on_track < 1 && on_bridge >= 0 && on_bridge < 1)) continue;  // nor where turn is 0
      const Eigen::Vector2d at = a + on_track * along;
      const double sine = std::abs(turn) / (along.norm() * across.norm());
      std::string name = value_of(*over.tags, "bridge:name");
      if (name.empty()) name = value_of(*over.tags, "name");
      found.push_back({track.alignment.nearest(at.x(), at.y()).offset_m,
                       0.5 * kUsualWidthM / std::max(sine, kLeastSine), std::move(name)});
    }
  }
  std::sort(found.begin(), found.end(), [](const auto& x, const auto& y) { return x.offset_m < y.offset_m; });
  return found;
}

void OsmOverbridges::add(const OsmData& data, const OsmChain& chain, ImportedTrack& track) const {
  const std::vector<Crossing> found = crossings(data, chain, track);
  for (size_t i = 0; i < found.size();) {
    double from_m = found[i].offset_m - found[i].half_m;
    double to_m = found[i].offset_m + found[i].half_m;
    std::string name = found[i].name;
    for (++i; i < found.size() && found[i].offset_m - found[i - 1].offset_m < kOneBridgeM; ++i) {
      from_m = std::min(from_m, found[i].offset_m - found[i].half_m);
      to_m = std::max(to_m, found[i].offset_m + found[i].half_m);
      if (name.empty()) name = found[i].name;
    }
    const double middle_m = std::clamp(0.5 * (from_m + to_m), 0.0, track.alignment.length_m());
    track.marks.push_back({LandmarkKind::bridge, middle_m, 0,
                           std::hypot(kMappingSigmaM, (to_m - from_m) / std::sqrt(12.0)), std::move(name)});
  }
}

}  // namespace railfix::track
