#include "track/import/osm/osm_trackside.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <tuple>

#include "track/import/fit/plane.hpp"
#include "track/import/osm/osm_cells.hpp"
#include "track/import/osm/osm_overbridges.hpp"

namespace railfix::track {
namespace {

constexpr double kStepM = 2;         // between the places that are looked at
constexpr double kEdgeReachM = 4;    // an edge is 1.7 m from the track; the rest is for the drawing
constexpr double kMiddleReachM = 8;  // the middle of a wide platform
constexpr double kAsFarM = 1.5;      // a middle line is as far from both its tracks, give or take this
constexpr double kLeastM = 0.7;      // nearer, and the side is anyone's guess
constexpr double kMastReachM = 6;    // of a mast from its track
constexpr double kParallelSine = 0.35;
constexpr double kShortestM = 15;  // what is shorter is a corner
constexpr double kSliverM = 5;
constexpr double kSameM = 10;      // parts of one platform lie no farther apart
constexpr double kAtEndM = 5;      // of a track
constexpr double kRampM = 10;      // over which an end slopes down: nobody knows which end of it was drawn
constexpr double kMiddleEndM = 5;  // a middle line need not reach the end

/// In a tunnel, and not in a hall.
bool is_below_ground(const OsmTags& track) {
  return is_set(track, "tunnel") && value_of(track, "tunnel") != "building_passage";
}

/// A platform of this track's level, as far as the two say.
bool same_level(const OsmTags& platform, const OsmTags& track) {
  const bool below = layer_of(platform) < 0 || value_of(platform, "location") == "underground" ||
                     value_of(platform, "level").starts_with('-');
  if (below != is_below_ground(track)) return false;
  return !platform.contains("layer") || layer_of(platform) == layer_of(track);
}

std::string name_of(const OsmTags& tags) {
  for (const char* key : {"name", "local_ref", "ref"}) {
    std::string text = value_of(tags, key);
    if (!text.empty()) return text;
  }
  return "";
}

}  // namespace

OsmTrackside::OsmTrackside(const OsmData& data, const Projection& projection, const std::vector<OsmChain>& chains,
                           Draft& draft)
    : data_(data), projection_(projection), chains_(chains), draft_(draft) {
  index_tracks();
}

void OsmTrackside::index_tracks() {
  for (size_t chain = 0; chain < chains_.size(); ++chain) {
    const std::vector<Eigen::Vector2d>& points = chains_[chain].points;
    std::vector<double>& along_m = along_m_.emplace_back(1, 0.0);
    for (size_t i = 0; i + 1 < points.size(); ++i) {
      const double length_m = (points[i + 1] - points[i]).norm();
      along_m.push_back(along_m.back() + length_m);
      if (!(length_m < kLongestSegmentM)) continue;
      for_cells(points[i].cwiseMin(points[i + 1]), points[i].cwiseMax(points[i + 1]),
                [&](int64_t cell) { in_cell_[cell].push_back(segments_.size()); });
      segments_.push_back({chain, i});
    }
    for (const bool at_end : {false, true}) ends_at_[node_of(chain, at_end)].emplace_back(chain, at_end);
  }
}

size_t OsmTrackside::add_platforms() {
  size_t beside_nothing = 0;
  for (const OsmWay& platform : data_.platforms) {
    const size_t before = stretches_.size();
    look_beside(platform);
    if (stretches_.size() == before) ++beside_nothing;
  }
  merge();
  find_where_they_go_on();
  for (const Stretch& stretch : stretches_) {
    const bool is_corner =
        stretch.to_m - stretch.from_m < kShortestM && !stretch.goes_on_before && !stretch.goes_on_behind;
    if (is_corner) continue;
    if (!stretch.goes_on_before) add_end(stretch, stretch.from_m);
    if (!stretch.goes_on_behind) add_end(stretch, stretch.to_m);
  }
  return beside_nothing;
}

OsmTrackside::Drawn OsmTrackside::drawn_as(const OsmWay& way) {
  if (value_of(way.tags, "railway") == "platform_edge") return Drawn::edge;
  const bool is_ring = way.nodes.size() > 3 && way.nodes.front() == way.nodes.back();
  // A way of an outline need not be the whole of it.
  const bool is_outline = value_of(way.tags, "type") == "multipolygon" || value_of(way.tags, "area") == "yes";
  return is_outline || (is_ring && value_of(way.tags, "area") != "no") ? Drawn::area : Drawn::line;
}

/// Walks along the drawing and notes where which tracks are beside it.
void OsmTrackside::look_beside(const OsmWay& platform) {
  const Drawn drawn = drawn_as(platform);
  std::map<Side, std::vector<double>> beside_m;
  for (size_t i = 1; i < platform.nodes.size(); ++i) {
    const auto a = place_of(platform.nodes[i - 1]);
    const auto b = place_of(platform.nodes[i]);
    if (!a || !b || !((*b - *a).norm() < kLongestSegmentM) || *a == *b) continue;
    const Eigen::Vector2d step = *b - *a;
    const int count = std::max(1, static_cast<int>(std::ceil(step.norm() / kStepM)));
    for (int k = 0; k <= count; ++k) {
      for (const Foot& foot : tracks_beside(*a + step * k / count, step.normalized(), platform.tags, drawn))
        beside_m[foot.side].push_back(foot.along_m);
    }
  }
  for (auto& [side, along_m] : beside_m) {
    std::sort(along_m.begin(), along_m.end());
    for (size_t first = 0, i = 1; i <= along_m.size(); ++i) {
      if (i < along_m.size() && along_m[i] - along_m[i - 1] < kSameM) continue;
      stretches_.push_back({side, along_m[first], along_m[i - 1], drawn, name_of(platform.tags)});
      first = i;
    }
  }
}

/// The nearest track beside this place of a drawing that runs in `direction`; of a line in the middle of a platform,
/// the nearest on either side.
std::vector<OsmTrackside::Foot> OsmTrackside::tracks_beside(const Eigen::Vector2d& at, const Eigen::Vector2d& direction,
                                                            const OsmTags& platform, Drawn drawn) const {
  const double reach_m = drawn == Drawn::line ? kMiddleReachM : kEdgeReachM;
  auto sides =
      on_either_side(at, direction, reach_m, [&](const OsmTags& track) { return same_level(platform, track); });
  if (sides[1] && (!sides[0] || sides[1]->away_m < sides[0]->away_m)) std::swap(sides[0], sides[1]);
  const auto& [nearest, other] = sides;
  std::vector<Foot> found;
  if (nearest && nearest->away_m > kLeastM) found.push_back(*nearest);
  if (!found.empty() && drawn == Drawn::line && other && other->away_m < nearest->away_m + kAsFarM)
    found.push_back(*other);
  return found;
}

template <class Accept>
std::array<std::optional<OsmTrackside::Foot>, 2> OsmTrackside::on_either_side(const Eigen::Vector2d& at,
                                                                              const Eigen::Vector2d& direction,
                                                                              double reach_m,
                                                                              const Accept& accept) const {
  std::array<std::optional<Foot>, 2> nearest;
  for_feet(at, reach_m, [&](const Foot& foot) {
    if (!(std::abs(cross(foot.direction, direction)) < kParallelSine) || !accept(*foot.track)) return;
    std::optional<Foot>& best = nearest[cross(direction, foot.at - at) > 0 ? 1 : 0];
    if (!best || foot.away_m < best->away_m) best = foot;
  });
  return nearest;
}

template <class Use>
void OsmTrackside::for_feet(const Eigen::Vector2d& at, double reach_m, const Use& use) const {
  const Eigen::Vector2d reach(reach_m, reach_m);
  for_cells(at - reach, at + reach, [&](int64_t cell) {
    const auto in = in_cell_.find(cell);
    if (in == in_cell_.end()) return;
    for (const size_t number : in->second) {
      const auto foot = foot_on(segments_[number], at);
      if (foot && foot->away_m <= reach_m) use(*foot);
    }
  });
}

std::optional<OsmTrackside::Foot> OsmTrackside::foot_on(const Segment& segment, const Eigen::Vector2d& at) const {
  const OsmChain& chain = chains_[segment.chain];
  const Eigen::Vector2d& begin = chain.points[segment.index];
  const Eigen::Vector2d step = chain.points[segment.index + 1] - begin;
  const double length_m = step.norm();
  const Eigen::Vector2d direction = step / length_m;
  const double along_m = direction.dot(at - begin);
  const double within_m = std::clamp(along_m, 0.0, length_m);
  // Where the track bends away from the place, its feet on both segments miss each other by a little.
  if (!(std::abs(along_m - within_m) <= 0.5 * kStepM)) return std::nullopt;
  const double left_m = cross(direction, at - begin);
  return Foot{{segment.chain, left_m > 0},
              along_m_[segment.chain][segment.index] + within_m,
              std::abs(left_m),
              begin + within_m * direction,
              direction,
              &data_.ways[chain.ways[segment.index]].tags};
}

std::optional<Eigen::Vector2d> OsmTrackside::place_of(int64_t node) const {
  const auto found = data_.nodes.find(node);
  return found == data_.nodes.end() ? std::nullopt : projection_.from_geo(found->second.place);
}

size_t OsmTrackside::add_masts() {
  std::vector<int64_t> masts;
  for (const auto& [id, node] : data_.nodes) {
    if (is_mast(node.tags)) masts.push_back(id);
  }
  std::sort(masts.begin(), masts.end());  // the same file always gives the same map
  size_t beside_nothing = 0;
  for (const int64_t id : masts) beside_nothing += add_mast(id) ? 0 : 1;
  return beside_nothing;
}

bool OsmTrackside::add_mast(int64_t node) {
  const auto at = place_of(node);
  if (!at) return false;
  const auto in_the_open = [](const OsmTags& track) { return !is_below_ground(track); };
  std::optional<Foot> nearest;
  for_feet(*at, kMastReachM, [&](const Foot& foot) {
    if (in_the_open(*foot.track) && (!nearest || foot.away_m < nearest->away_m)) nearest = foot;
  });
  if (!nearest || nearest->away_m < kLeastM) return false;
  for (const auto& foot : on_either_side(*at, nearest->direction, kMastReachM, in_the_open)) {
    if (!foot) continue;
    draft_.edges[foot->side.chain].track.marks.push_back(
        {LandmarkKind::mast, offset_of(foot->side.chain, foot->along_m), foot->side.left ? foot->away_m : -foot->away_m,
         kMappingSigmaM, value_of(data_.nodes.at(node).tags, "ref")});
  }
  return true;
}

/// Beside one side of one track the most exact drawing counts, and what lies close together is one platform.
void OsmTrackside::merge() {
  std::stable_sort(stretches_.begin(), stretches_.end(), [](const Stretch& a, const Stretch& b) {
    return std::tie(a.side, a.drawn, a.from_m) < std::tie(b.side, b.drawn, b.from_m);
  });
  std::vector<Stretch> kept;
  size_t side_begin = 0;
  for (Stretch& stretch : stretches_) {
    if (!kept.empty() && kept.back().side != stretch.side) side_begin = kept.size();
    const auto touched =
        std::find_if(kept.begin() + static_cast<ptrdiff_t>(side_begin), kept.end(), [&](const Stretch& other) {
          return stretch.from_m < other.to_m + kSameM && other.from_m < stretch.to_m + kSameM;
        });
    if (touched == kept.end()) {
      kept.push_back(std::move(stretch));
    } else if (touched->drawn == stretch.drawn) {
      touched->from_m = std::min(touched->from_m, stretch.from_m);
      touched->to_m = std::max(touched->to_m, stretch.to_m);
      if (touched->name.empty()) touched->name = stretch.name;
    }
  }
  // At the blades of a switch both legs are as near: the one that leads away is touched for a step or two.
  std::erase_if(kept, [&](const Stretch& stretch) {
    return stretch.to_m - stretch.from_m < kSliverM && !(reaches(stretch, false) && reaches(stretch, true));
  });
  stretches_ = std::move(kept);
}

void OsmTrackside::find_where_they_go_on() {
  for (Stretch& stretch : stretches_) {
    stretch.goes_on_before = goes_on(stretch, false);
    stretch.goes_on_behind = goes_on(stretch, true);
  }
}

bool OsmTrackside::reaches(const Stretch& stretch, bool at_end) const {
  return at_end ? along_m_[stretch.side.chain].back() - stretch.to_m < kAtEndM : stretch.from_m < kAtEndM;
}

/// Past this end of its track: beside the next one, or where no track is any more.
bool OsmTrackside::goes_on(const Stretch& stretch, bool at_end) const {
  if (!reaches(stretch, at_end)) return false;
  const auto& ends = ends_at_.at(node_of(stretch.side.chain, at_end));
  if (ends.size() == 1) return true;
  const bool left_leaving = stretch.side.left == at_end;
  return std::any_of(stretches_.begin(), stretches_.end(), [&](const Stretch& next) {
    return std::any_of(ends.begin(), ends.end(), [&](const auto& end) {
      const auto& [chain, is_end] = end;
      if (chain != next.side.chain || (chain == stretch.side.chain && is_end == at_end)) return false;
      const bool left_entering = next.side.left != is_end;
      return left_entering == left_leaving && reaches(next, is_end);
    });
  });
}

void OsmTrackside::add_end(const Stretch& stretch, double along_m) {
  const double drawn_m = stretch.drawn == Drawn::line ? std::hypot(kMappingSigmaM, kMiddleEndM) : kMappingSigmaM;
  draft_.edges[stretch.side.chain].track.marks.push_back({LandmarkKind::platform,
                                                          offset_of(stretch.side.chain, along_m),
                                                          stretch.side.left ? kPlatformEdgeM : -kPlatformEdgeM,
                                                          std::hypot(drawn_m, kRampM / std::sqrt(12.0)), stretch.name});
}

double OsmTrackside::offset_of(size_t chain, double along_m) const {
  const std::vector<double>& of_points = along_m_[chain];
  const auto after = std::upper_bound(of_points.begin() + 1, of_points.end() - 1, along_m);
  const auto i = static_cast<size_t>(after - of_points.begin());
  const std::vector<Eigen::Vector2d>& points = chains_[chain].points;
  const double part = (along_m - of_points[i - 1]) / std::max(of_points[i] - of_points[i - 1], 1e-9);
  const Eigen::Vector2d at = points[i - 1] + part * (points[i] - points[i - 1]);
  return draft_.edges[chain].track.alignment.nearest(at.x(), at.y()).offset_m;
}

}  // namespace railfix::track
