#include "track/map.hpp"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <memory>
#include <span>
#include <string_view>

#include "core/joined.hpp"

namespace railfix::track {
namespace {

constexpr std::array<std::string_view, 10> kLandmarkKinds{"unknown",        "frog",       "balise", "portal_in",
                                                          "portal_out",     "mast",       "bridge", "platform",
                                                          "level_crossing", "underbridge"};
constexpr std::array<std::string_view, 4> kNodeKinds{"end", "joint", "switch", "crossing"};

std::optional<double> number_from(std::string_view text) {
  double value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc() || end != text.data() + text.size() || !std::isfinite(value)) return std::nullopt;
  return value;
}

/// The projection of this thread; made anew when a map with another system asks.
const Projection* projection_for(const std::string& crs) {
  struct Cached {
    std::string crs;
    std::unique_ptr<Projection> projection;
  };
  thread_local Cached cached;
  if (crs.empty()) return nullptr;
  if (cached.crs != crs) {
    core::Result<Projection> opened = Projection::open(crs);
    cached.crs = crs;
    cached.projection.reset();
    if (opened.ok()) cached.projection = std::make_unique<Projection>(std::move(opened).value());
  }
  return cached.projection.get();  // NOLINT(clang-analyzer-cplusplus.NewDelete): clang-tidy 14 takes it for freed
}

/// A line that was cut at switches is called NAME, NAME#2, ...: counts on over its pieces, which need not follow one
/// another in the map, as far as each begins where the last one ends.
const Edge* piece_at(const Map& map, const Edge& first, double& offset_m) {
  const Edge* piece = &first;
  for (int number = 2; offset_m > piece->alignment.length_m(); ++number) {
    const std::string name = first.name + "#" + std::to_string(number);
    const auto next = std::find_if(map.edges.begin(), map.edges.end(), [&](const Edge& edge) {
      return edge.from_node == piece->to_node && edge.name == name;
    });
    if (next == map.edges.end()) break;
    offset_m -= piece->alignment.length_m();
    piece = &*next;
  }
  return piece;
}

constexpr std::string_view kByNumber = "edge/";

/// Nullptr where the text is no number, or of no edge.
const Edge* edge_numbered(const Map& map, std::string_view text) {
  if (text.starts_with(kByNumber)) text.remove_prefix(kByNumber.size());
  uint32_t id = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), id);
  return error == std::errc() && end == text.data() + text.size() ? map.edge(id) : nullptr;
}

core::Result<const Edge*> edge_meant(const Map& map, std::string_view text) {
  const Edge* const numbered = edge_numbered(map, text);
  if (numbered != nullptr && text.starts_with(kByNumber)) return numbered;
  std::vector<const Edge*> meant;
  for (const Edge& edge : map.edges) {
    if (&edge == numbered || edge.name == text) meant.push_back(&edge);
  }
  const std::string said = "\"" + std::string(text) + "\"";
  if (meant.empty()) return core::Error{"the map has no edge " + said + "; `railfix map info` lists its edges"};
  if (meant.size() == 1) return meant.front();
  std::vector<std::string> ways;
  for (const Edge* edge : meant) {
    constexpr size_t kMostNamed = 8;
    if (ways.size() < kMostNamed) ways.push_back(std::string(kByNumber) + std::to_string(edge->id));
  }
  return core::Error{said +
                     (numbered != nullptr ? " is the number of one edge and the name of another"
                                          : " is the name of " + std::to_string(meant.size()) + " edges") +
                     "; write one of " + core::joined(ways) + " instead"};
}

}  // namespace

std::string to_string(LandmarkKind kind) {
  return std::string(kLandmarkKinds.at(static_cast<size_t>(kind)));
}

std::optional<LandmarkKind> landmark_kind_from(const std::string& text) {
  const auto* const found = std::find(kLandmarkKinds.begin(), kLandmarkKinds.end(), text);
  if (found == kLandmarkKinds.end()) return std::nullopt;
  return static_cast<LandmarkKind>(found - kLandmarkKinds.begin());
}

std::string landmark_kinds() {
  return core::joined(std::span(kLandmarkKinds).subspan(1));  // the first one is no kind
}

std::string sighted_kinds() {
  std::vector<std::string> names;
  for (size_t i = 0; i < kLandmarkKinds.size(); ++i) {
    if (can_be_sighted(static_cast<LandmarkKind>(i))) names.emplace_back(kLandmarkKinds[i]);
  }
  return core::joined(names);
}

LandmarkKind seen_along(LandmarkKind kind, bool forward) {
  if (forward) return kind;
  if (kind == LandmarkKind::portal_in) return LandmarkKind::portal_out;
  return kind == LandmarkKind::portal_out ? LandmarkKind::portal_in : kind;
}

std::string to_string(NodeKind kind) {
  return std::string(kNodeKinds.at(static_cast<size_t>(kind)));
}

std::optional<double> Edge::speed_limit_mps(double offset_m, Direction running) const {
  std::optional<double> lowest;
  for (const SpeedLimit& limit : speed_limits) {
    if (offset_m < limit.from_m || offset_m > limit.to_m) continue;
    if (limit.direction != Direction::unknown && limit.direction != running) continue;
    lowest = std::min(limit.speed_mps, lowest.value_or(limit.speed_mps));
  }
  return lowest;
}

const Edge* Map::edge(uint32_t id) const {
  return id >= 1 && id <= edges.size() ? &edges[id - 1] : nullptr;
}

const Landmark* Map::landmark(uint32_t id) const {
  return id >= 1 && id <= landmarks.size() ? &landmarks[id - 1] : nullptr;
}

core::Result<EdgePosition> Map::parse_position(const std::string& text) const {
  const core::Error malformed{"\"" + text +
                              "\" is not a place on the map; write EDGE:OFFSET, EDGE:OFFSET:+ or EDGE:OFFSET:-"};
  EdgePosition out;
  std::string_view rest = text;
  if (rest.ends_with(":+") || rest.ends_with(":-")) {
    out.direction = rest.back() == '+' ? Direction::forward : Direction::reverse;
    rest.remove_suffix(2);
  }
  const size_t colon = rest.rfind(':');
  if (colon == std::string_view::npos || colon == 0) return malformed;
  const std::optional<double> offset = number_from(rest.substr(colon + 1));
  if (!offset) return malformed;
  out.offset_m = *offset;

  const std::string_view wanted = rest.substr(0, colon);
  const core::Result<const Edge*> meant = edge_meant(*this, wanted);
  if (!meant.ok()) return meant.error();
  const Edge* found = meant.value();
  if (edge_numbered(*this, wanted) == nullptr) found = piece_at(*this, *found, out.offset_m);
  out.edge = found->id;
  constexpr double kWrittenM = 1e-3;  // `railfix map info` writes lengths so finely
  if (out.offset_m < 0 || out.offset_m > found->alignment.length_m() + kWrittenM) {
    return core::Error{"offset " + std::string(rest.substr(colon + 1)) + " is not on edge " + std::string(wanted) +
                       ", which is " + std::to_string(*offset - out.offset_m + found->alignment.length_m()) +
                       " m long"};
  }
  out.offset_m = std::min(out.offset_m, found->alignment.length_m());
  return out;
}

std::string Map::edge_text(uint32_t id) const {
  const std::string number = std::to_string(id);
  const bool is_name = std::ranges::any_of(edges, [&](const Edge& e) { return e.id != id && e.name == number; });
  return (is_name ? std::string(kByNumber) : "") + number;
}

std::vector<const Landmark*> Map::landmarks_on(uint32_t edge_id) const {
  std::vector<const Landmark*> found;
  const auto take = [&](const Landmark& candidate) {
    if (candidate.edge == edge_id) found.push_back(&candidate);
  };
  if (by_edge_.all == landmarks.data() && by_edge_.count == landmarks.size()) {
    if (edge_id < 1 || edge_id >= by_edge_.first.size()) return found;
    for (uint32_t i = by_edge_.first[edge_id - 1]; i < by_edge_.first[edge_id]; ++i) take(landmarks[by_edge_.order[i]]);
  } else {
    for (const Landmark& candidate : landmarks) take(candidate);
  }
  std::stable_sort(found.begin(), found.end(), [](const auto* a, const auto* b) { return a->offset_m < b->offset_m; });
  return found;
}

void Map::index_landmarks() {
  by_edge_ = {.all = landmarks.data(), .count = landmarks.size(), .first = {}, .order = {}};
  by_edge_.first.assign(edges.size() + 1, 0);
  for (const Landmark& landmark : landmarks) ++by_edge_.first[landmark.edge];
  for (size_t i = 1; i < by_edge_.first.size(); ++i) by_edge_.first[i] += by_edge_.first[i - 1];
  std::vector<uint32_t> next = by_edge_.first;
  by_edge_.order.resize(landmarks.size());
  for (uint32_t i = 0; i < landmarks.size(); ++i) by_edge_.order[next[landmarks[i].edge - 1]++] = i;
}

std::optional<GeoPoint> Map::to_geo(double easting_m, double northing_m) const {
  const Projection* projection = projection_for(crs);
  return projection != nullptr ? projection->to_geo(easting_m, northing_m) : std::nullopt;
}

std::optional<Eigen::Vector2d> Map::from_geo(const GeoPoint& point) const {
  const Projection* projection = projection_for(crs);
  return projection != nullptr ? projection->from_geo(point) : std::nullopt;
}

}  // namespace railfix::track
