// A small camera on the built-in line.
#pragma once

#include <memory>
#include <string>

#include "dataset/dataset.hpp"
#include "simulator/builtin_line.hpp"
#include "simulator/renderer.hpp"

namespace railfix::simulator {

inline std::shared_ptr<const Line> line_from(const std::string& start, const std::vector<uint32_t>& via = {}) {
  const auto map = std::make_shared<const track::Map>(builtin_line());
  return std::make_shared<const Line>(Line::make(map, map->parse_position(start).value(), 400.0, via).value());
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

inline dataset::TruthRow truth_of(const Shot& shot) {
  dataset::TruthRow truth;
  truth.distance_m = shot.distance_m;
  truth.camera = shot.pose;
  return truth;
}

}  // namespace railfix::simulator
