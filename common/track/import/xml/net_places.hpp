// Where one thing (a tunnel, a platform) lies when a source tells it in stretches of several tracks.
#pragma once

#include <string>
#include <utility>
#include <vector>

#include "track/import/xml/rail_net.hpp"

namespace railfix::track {

constexpr double kNetTouchM = 0.5;  // what is nearer meets

/// A spot or a stretch of a track, along it.
struct NetPlace {
  size_t track = 0;
  double from_m = 0;
  double to_m = 0;
  bool same_direction = true;
  double lateral_m = 0;  // of the track's direction, left positive; stretches on both sides of it are not one thing
};

/// Where a thing begins or ends, as offsets of the track grow.
struct NetSpot {
  size_t track = 0;
  double offset_m = 0;
  bool begins = false;
  size_t place = 0;  // of the stretch that it is told by
};

/// Where the whole thing begins and ends: a stretch that goes on in another one, over a link that trains run, does not.
std::vector<NetSpot> ends_of(const RailNet& net, const std::vector<NetPlace>& places);

/// The portals of a tunnel: one that goes on over one leg of a switch has its portal on the leg that leaves it, as
/// every way meets one.
std::vector<NetSpot> portals_of(const RailNet& net, const std::vector<NetPlace>& places);
TrackMark portal(const NetSpot& spot, double sigma_m, const std::string& name);

/// The middle of the thing on every track that it crosses: stretches that follow one another are one. Track, offset.
std::vector<std::pair<size_t, double>> middles(const RailNet& net, const std::vector<NetPlace>& places);

}  // namespace railfix::track
