// Gradients in railML 3.
#pragma once

#include "track/import/xml/railml3_places.hpp"

namespace railfix::track {

/// Slopes hold where the file says; an arc without a gradient rounds the change from the slope before it to the one
/// behind. Where a track has slopes and none holds, it is level, which `net.problems` says.
void read_slopes3(const XmlSource& source, Railml3Places& places, RailNet& net);

}  // namespace railfix::track
