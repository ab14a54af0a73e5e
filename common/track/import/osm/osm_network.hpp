// OpenStreetMap ways to edges between switches, with tangents that agree at every node.
#pragma once

#include "track/import/fit/clothoid_fit.hpp"
#include "track/import/network.hpp"
#include "track/import/osm/osm_data.hpp"

namespace railfix::track {

struct OsmNetwork {
  Draft draft;
  FitFigures figures;
  FitReport fit;
  std::vector<std::string> cuts;  // problems that cut the network
  std::vector<std::string> problems;
};

/// Ways are cut and joined so that edges run from switch to switch (or end, or crossing). Tunnels become portals,
/// bridges over and under the track, ends of platforms, signals, level crossings and balises landmarks, maxspeed speed
/// limits, incline and ele profiles; offsets are as good as the mapping, taken as 3 m (1 sigma). `smooth_m` lets the
/// mapped points move by as much to even out the curvature; 0 keeps them where they are. With `with_clothoids` the
/// tracks are straights, clothoids and arcs that pass the points within their scatter, where there are enough points;
/// else two arcs between every pair of points.
core::Result<OsmNetwork> build_osm_network(const OsmData& data, const Projection& projection, double smooth_m,
                                           bool with_clothoids = false);

/// Middle of the tracks' bounding box.
std::optional<GeoPoint> middle_of(const OsmData& data);

}  // namespace railfix::track
