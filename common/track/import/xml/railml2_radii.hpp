// Radii and cant in railML 2.
#pragma once

#include "track/import/xml/rail_net.hpp"
#include "track/import/xml/xml_source.hpp"

namespace railfix::track {

/// Of one track's <radiusChanges>, its begin at mileage `origin_m`: its bends, and of a superelevation the amount, with
/// the outer rail as the higher one. The schema defines no sign; what is below 0, or on a straight, is told.
void read_radii2(const XmlSource& source, const pugi::xml_node& radius_changes, double origin_m, NetTrack& track,
                 std::vector<std::string>& problems);

}  // namespace railfix::track
