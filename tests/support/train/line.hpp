// Random railway lines for simulations without pictures.
#pragma once

#include <memory>
#include <vector>

#include "core/random.hpp"
#include "track/map.hpp"

namespace railfix::train {

struct RandomLine {
  std::shared_ptr<track::Map> map;
  std::vector<uint32_t> way;  // edges that the train runs over, from the line's begin
};

/// From edge 1 on: straights, clothoids and arcs of 400 to 2500 m radius, grades to 1.5 %. No landmarks. About every
/// switch_spacing_m (0 = never) the points divide the track, and the way takes either leg: half of them begin a loop
/// 4.5 m beside the line, which comes back over trailing points, half a line of its own that leads away.
RandomLine random_line(core::Random& random, double length_m, double switch_spacing_m = 0);

}  // namespace railfix::train
