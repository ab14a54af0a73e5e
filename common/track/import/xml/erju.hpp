// The digital map of ERJU's System Pillar (erju.org/infra and erju.org/map, version 1.0): track edges, links, switch
// points, balise groups with their ETCS identity, marker boards, slopes and cant from the infrastructure file;
// coordinates from the map file.
#pragma once

#include <filesystem>

#include "core/result.hpp"
#include "track/import/xml/rail_net.hpp"

namespace railfix::track {

/// Positions in the files are millimetres along an edge. Without a map file the plan is laid out from azimuths and
/// radii, in a plane of its own. REQUIRES: `infra` has <infrastructure> as its first element, `map` <mapMgmt>.
core::Result<RailNet> read_erju(const std::filesystem::path& infra, const std::filesystem::path* map);

}  // namespace railfix::track
