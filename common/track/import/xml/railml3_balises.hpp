// Balises and their groups in railML 3.
#pragma once

#include "track/import/xml/railml3_places.hpp"

namespace railfix::track {

/// Groups with an ETCS identity, their reference balise first; what is in no such group is a landmark.
void read_balises3(const XmlSource& source, Railml3Places& places, RailNet& net);

}  // namespace railfix::track
