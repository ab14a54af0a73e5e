// Where one thing (a tunnel, a platform) lies when a source tells it in stretches of several tracks.
#pragma once

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
};

/// Whether a stretch goes on at this end in another stretch of the same thing, over a link that trains run.
bool goes_on(const RailNet& net, const std::vector<NetPlace>& places, const NetPlace& place, bool at_end);

/// Ends of tracks on which trains leave the thing beside where it goes on: the other leg of a switch inside it.
std::vector<NetEnd> legs_outside(const RailNet& net, const std::vector<NetPlace>& places, const NetPlace& place,
                                 bool at_end);

/// The middle of the thing on every track that it crosses: stretches that follow one another are one. Track, offset.
std::vector<std::pair<size_t, double>> middles(const RailNet& net, const std::vector<NetPlace>& places);

}  // namespace railfix::track
