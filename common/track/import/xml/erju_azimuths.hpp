// The headings that an ERJU map gives along a track edge.
#pragma once

#include <optional>

#include "track/import/xml/erju_edges.hpp"

namespace railfix::track {

/// Where a straight, an arc or a transition begins.
struct ErjuAzimuth {
  double offset_m = 0;
  double heading_rad = 0;
  bool is_curved = false;
  std::optional<double> arc_curvature_per_m{};  // of an arc; its radius is left positive, as azimuths beside it show
};

/// By their offset.
std::vector<ErjuAzimuth> azimuths_of(const XmlSource& infra, const pugi::xml_node& geometry);

/// How the track curves about a place, over the azimuths next to it; 0 where there are none on both sides.
double curvature_about(const std::vector<ErjuAzimuth>& azimuths, double offset_m);

/// The straights and arcs of a track of this length where they meet without a turn; empty where azimuths only follow a
/// drawing, turning from straight to straight.
std::vector<Element> plan_of(const std::vector<ErjuAzimuth>& azimuths, double length_m);

/// Bends from azimuth to azimuth; an arc that no azimuth ends has its radius up to the end of the track. A track
/// measured to and fro turns back for a metre or two: such azimuths are left out, and told.
void add_bends(const std::vector<ErjuAzimuth>& azimuths, NetTrack& track, std::vector<std::string>& problems);

}  // namespace railfix::track
