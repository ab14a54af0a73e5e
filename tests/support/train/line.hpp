// Random railway lines for simulations without pictures.
#pragma once

#include <memory>
#include <vector>

#include "core/random.hpp"
#include "track/map.hpp"

namespace railfix::train {

/// Beside which the train passes.
struct Thing {
  track::LandmarkKind kind = track::LandmarkKind::unknown;
  uint32_t edge = 0;
  double offset_m = 0;
  double lateral_m = 0;
};

inline constexpr double kMastBesideM = 3.0;

struct RandomLine {
  std::shared_ptr<track::Map> map;
  std::vector<uint32_t> way;  // edges that the train runs over, from the line's begin
  std::vector<Thing> things;  // as they stand; the map may have them elsewhere
};

/// From edge 1 on: straights, clothoids and arcs of 400 to 2500 m radius, grades to 1.5 %. No landmarks. About every
/// switch_spacing_m (0 = never) the points divide the track, and the way takes either leg: half of them begin a loop
/// 4.5 m beside the line, which comes back over trailing points, half a line of its own that leads away. The first are
/// beyond first_switch_m.
RandomLine random_line(core::Random& random, double length_m, double switch_spacing_m, double first_switch_m);

/// A mast every 40 to 65 m and a pair of balises every 0.4 to 1.6 km, on all tracks. The map has them to 0.1 m, 3 % of
/// the masts 1 to 6 m elsewhere, and 3 % of the balises not; as many are on the map only.
void furnish(RandomLine& line, core::Random& random);

}  // namespace railfix::train
