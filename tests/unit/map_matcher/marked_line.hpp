// A straight line of 20 km with landmarks.
#pragma once

#include <memory>
#include <utility>
#include <vector>

#include "core/result.hpp"
#include "track/path.hpp"

namespace railfix::map_matcher {

/// Kinds and offsets on edge 1.
inline std::shared_ptr<const track::Map> marked_line(
    const std::vector<std::pair<track::LandmarkKind, double>>& landmarks) {
  auto map = std::make_shared<track::Map>();
  map->edges.push_back({1, "line", 1, 2, "", track::Alignment::chained({0, 0, 0}, {{20000, 0, 0}})});
  map->nodes = {{1, track::NodeKind::end, "", 0, 0}, {2, track::NodeKind::end, "", 0, 20000}};
  uint32_t id = 0;
  for (const auto& [kind, offset_m] : landmarks) map->landmarks.push_back({++id, kind, 1, offset_m, 0, 0.1, ""});
  return map;
}

inline std::shared_ptr<const track::Path> path_along(std::shared_ptr<const track::Map> line) {
  return std::make_shared<const track::Path>(
      core::value_or_throw(track::Path::follow(std::move(line), {1, 0, track::Direction::forward}, 20000, 0)));
}

}  // namespace railfix::map_matcher
