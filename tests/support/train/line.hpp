// Random railway lines for simulations without pictures.
#pragma once

#include <memory>

#include "core/random.hpp"
#include "track/map.hpp"

namespace railfix::train {

/// Edge 1: straights, clothoids and arcs of 400 to 2500 m radius, grades to 1.5 %. Edge 2 is a track beside it that is
/// not connected. No landmarks.
std::shared_ptr<track::Map> random_line(core::Random& random, double length_m);

}  // namespace railfix::train
