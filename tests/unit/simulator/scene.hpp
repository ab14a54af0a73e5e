// A small camera on the built-in line.
#pragma once

#include <memory>
#include <string>

#include "simulator/builtin_line.hpp"
#include "simulator/renderer.hpp"

namespace railfix::simulator {

inline std::shared_ptr<const Line> line_from(const std::string& start) {
  const auto map = std::make_shared<const track::Map>(builtin_line());
  return std::make_shared<const Line>(Line::make(map, map->parse_position(start).value(), 400.0).value());
}

inline RenderOptions small_camera() {
  RenderOptions options;
  options.camera = {576.0, 576.0, 319.5, 255.5, 0.0, 0.0, 0.0, 0.0, 640, 512};
  return options;
}

inline Shot standing_at(double distance_m) {
  Shot shot;
  shot.pose = {0.0, 0.2094, 0.0, 0.0, 2.5};
  shot.distance_m = distance_m;
  return shot;
}

}  // namespace railfix::simulator
