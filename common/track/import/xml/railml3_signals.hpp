// Signals, boards and stop posts in railML 3.
#pragma once

#include "track/import/xml/railml3_places.hpp"

namespace railfix::track {

/// Masts, but for virtual signals, on the side that the file says; `net.problems` says where it says none for sure.
void read_signals3(const XmlSource& source, Railml3Places& places, RailNet& net);

}  // namespace railfix::track
