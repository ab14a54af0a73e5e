// Signals and stop posts in railML 2.
#pragma once

#include "track/import/xml/rail_net.hpp"
#include "track/import/xml/xml_source.hpp"

namespace railfix::track {

/// Masts, but for virtual ones. `control`: the track's <ocsElements>. Which side they stand on only extensions say, as
/// the Norwegian nor:side, seen along the track; `problems` says where there is a distance and no side.
void read_signals2(const XmlSource& source, const pugi::xml_node& control, double origin_m, NetTrack& track,
                   std::vector<std::string>& problems);

}  // namespace railfix::track
