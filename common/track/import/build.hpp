// What `railfix map build` does: any mix of sources to one checked map.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "core/result.hpp"
#include "track/import/finish.hpp"
#include "track/import/fit/clothoid_fit.hpp"
#include "track/import/tracks.hpp"
#include "track/map.hpp"

namespace railfix::track {

struct BuildOptions {
  std::string crs{};  // "" = the LandXML's own, else the UTM zone of the data; "local" = true to scale around the
                      // middle of the data
  bool with_trams = false;
  bool with_clothoids = false;                    // polylines of OpenStreetMap become straights, clothoids and arcs
  double smooth_m = 0;                            // how far points of OpenStreetMap may move to even out the curvature
  double virtual_balises_every_m = 0;             // 0 = none
  std::vector<std::string> virtual_balises_at{};  // "EDGE:OFFSET", besides these
  GroupNumbers virtual_numbers{};
  /// Of balise groups whose source says none. A bound, not a sigma: ERTMS/ETCS's own where nothing is known
  /// (Q_NVLOCACC, SUBSET-026 A.3.2), from which a trackside counts that has not said another one.
  double q_locacc_m = 12;
  std::vector<std::string> landmarks{};  // kinds that are kept; empty = all
};

struct BuiltMap {
  Map map;
  FitFigures landxml;  // zero elements where there was no such source
  FitFigures osm;
  FitFigures plans;  // railML and ERJU with coordinates
  FitReport fit;     // of all polylines
  VirtualBalises virtual_balises;
  std::string crs_remark;  // what --crs was taken for, where a source does not name its system
};

/// LandXML (.xml, .landxml), railML 2 and 3 (.xml, .railml), ERJU infrastructure and map (.xml, both together), OSM
/// (.osm, .pbf, also .gz/.bz2), Overpass JSON (.json), GeoJSON (.geojson) and compiled maps (.map). The problems found
/// are in the map: what cuts the network, then what has shapes that no track has, then what else was left out or
/// changed.
core::Result<BuiltMap> build_map(const std::vector<std::filesystem::path>& inputs, const BuildOptions& options);

}  // namespace railfix::track
