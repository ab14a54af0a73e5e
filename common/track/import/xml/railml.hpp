// railML 2.x (2.4: tracks with switches and connections) and 3.x (3.2: net elements and relations): topology, radii,
// gradients, cant, coordinates where given, switches, balise groups, tunnels, bridges, platforms, level crossings and
// signals (as masts). Radii are positive to the right, as railML 3 defines them.
#pragma once

#include <filesystem>

#include "core/result.hpp"
#include "track/import/xml/rail_net.hpp"

namespace railfix::track {

/// By the version in the first element.
core::Result<RailNet> read_railml(const std::filesystem::path& file);

}  // namespace railfix::track
