// A map as a picture: tracks coloured by their elements, switches, balise groups, landmarks, labels, a scale bar.
#pragma once

#include <Eigen/Core>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "core/result.hpp"
#include "track/map.hpp"

namespace railfix::tool {

struct DrawOptions {
  double width_px = 1600;
  std::optional<track::EdgePosition> around{};  // this place in the middle; the whole map without
  double radius_m = 1000;                       // no further than the map reaches
};

/// Shapes in pixels, x to the right, y down; drawn in their order.
struct Drawing {
  struct Colour {
    int red = 0, green = 0, blue = 0;
  };
  struct Line {
    std::vector<Eigen::Vector2d> points;
    Colour colour;
    double width = 1;
  };
  struct Dot {
    Eigen::Vector2d at = Eigen::Vector2d::Zero();
    Colour colour;
    double radius = 1;
    bool filled = true;
  };
  struct Label {
    Eigen::Vector2d at = Eigen::Vector2d::Zero();
    std::string text;
    double size = 11;
  };
  double width = 0;
  double height = 0;
  std::vector<Line> lines;
  std::vector<Dot> dots;
  std::vector<Label> labels;
};

/// REQUIRES: a map with edges.
Drawing draw_map(const track::Map& map, const DrawOptions& options);

/// By the name's ending, .svg or .png.
core::Status write_drawing(const Drawing& drawing, const std::filesystem::path& file);

}  // namespace railfix::tool
