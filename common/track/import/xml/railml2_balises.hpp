// Balises and their groups in railML 2.
#pragma once

#include "track/import/xml/rail_net.hpp"
#include "track/import/xml/xml_source.hpp"

namespace railfix::track {

/// Of one track's <balises>, its begin at mileage `origin_m`. Groups with an ETCS identity, their reference balise
/// first; what is in no such group is a landmark.
void read_balises2(const XmlSource& source, const pugi::xml_node& balises, double origin_m, NetTrack& track,
                   std::vector<std::string>& problems);

}  // namespace railfix::track
