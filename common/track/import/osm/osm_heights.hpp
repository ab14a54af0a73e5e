// How high the tracks of OpenStreetMap lie, and how steep they are.
#pragma once

#include "track/import/network.hpp"
#include "track/import/osm/osm_chains.hpp"

namespace railfix::track {

/// `incline`: "12‰", "-0.5 %", "2°" or "0", as the rise per metre along the way; nothing where it is no such number, or
/// one that no track has.
std::optional<double> grade_of(const std::string& text);

/// `ele`: "412" or "412.5", metres above the sea; nothing where it is no such number, or one where no track lies.
std::optional<double> elevation_of(const std::string& text);

/// The profile of every edge. Grades are those of `incline` alone: heights of nodes are whole metres, often of the
/// ground beside the track. `ele` says how high such stretches lie; the others climb evenly in between. All of it is a
/// guess: mappers are asked for the steepest part of a way, and an IMU believes the grade it is given.
/// `problems` tells how much is known, and what contradicts. REQUIRES: the draft's edges were made from the chains, in
/// their order.
void add_heights(const OsmData& data, const std::vector<OsmChain>& chains, Draft& draft,
                 std::vector<std::string>& problems);

}  // namespace railfix::track
