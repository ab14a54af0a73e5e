// Rail heads where tracks come together: blades against their stock rails, closure rails, frog with wing rails, nose
// and check rails. All follows from how far the tracks are apart at a place.
#pragma once

#include <span>

#include "simulator/ground_shader.hpp"

namespace railfix::simulator {

/// Shares of a pixel that are covered by the rail heads of one track.
struct HeadShare {
  float running = 0;  // worn bright by wheels
  float check = 0;    // check rails, wheels only graze them
};

/// `tracks` are the same place on every track that is near, the own first. A switch lies for the one that comes
/// first. The gauge faces of the own track are where the track is, but for the gap in a frog.
HeadShare head_share(std::span<const GroundPixel* const> tracks, size_t track);

/// True on the plate that a frog stands on.
bool frog_plate(std::span<const GroundPixel* const> tracks, size_t track);

/// True where a rail's foot shows: not where a blade lies on the stock rail.
bool foot_shows(std::span<const GroundPixel* const> tracks, size_t track);

}  // namespace railfix::simulator
