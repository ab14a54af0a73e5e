// Arcs and transition curves of railML 3.
#pragma once

#include "track/import/xml/railml3_places.hpp"

namespace railfix::track {

/// Puts every <horizontalCurve> on the tracks that it lies on. Transition curves lead from the curvature before them to
/// the one behind, on the next track too. REQUIRES: tracks, links and switches are read. Throws core::BadInput.
void read_curves3(const XmlSource& source, Railml3Places& places, RailNet& net);

}  // namespace railfix::track
