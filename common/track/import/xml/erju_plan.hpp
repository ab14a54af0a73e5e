// Azimuths, arcs, slopes and cant of an ERJU map's track edges.
#pragma once

#include "track/import/xml/erju_edges.hpp"

namespace railfix::track {

/// Cant and slopes everywhere. Azimuths and radii of arcs make bends where the track has no shape, and its plan where
/// it has one and they say all of it. `net.problems` says what is left out.
void read_erju_plan(const XmlSource& infra, const ErjuEdges& edges, RailNet& net);

}  // namespace railfix::track
