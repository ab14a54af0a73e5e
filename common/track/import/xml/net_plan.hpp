// The plan that a source gives a track beside its coordinates.
#pragma once

#include <optional>

#include "track/import/xml/rail_net.hpp"

namespace railfix::track {

/// The track's own elements from its first point on, turned so that they lead to its last one. Nothing where it has
/// none, or where its points do not bear them out, which `problems` says. REQUIRES: the track has a shape.
std::optional<ClothoidFit> own_plan(const NetTrack& track, std::vector<std::string>& problems);

}  // namespace railfix::track
