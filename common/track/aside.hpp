// How far beside the track something stands: what was sighted so far aside, is it what the map has there?
#pragma once

#include <cmath>

#include "track/map.hpp"

namespace railfix::track {

/// From the track's middle to a signal's mast where the source says its side alone: usual are 3.1 m to its near side
/// along main lines, 2.2 m in stations and between two tracks.
inline constexpr double kMastBesideM = 3.0;

/// Somebody did: the source does not say the side alone, nor is the landmark drawn to metres.
inline bool is_aside_measured(const Landmark& landmark) {
  constexpr double kDrawnSigmaM = 1.0;
  return landmark.lateral_m != 0 && std::abs(landmark.lateral_m) != kMastBesideM && landmark.sigma_m < kDrawnSigmaM;
}

/// Masts and platforms stand on one side. Two tracks have their masts outside of them: from each of them a train sees
/// its own ones at 3 m on the one hand and the other track's at 7 m on the other hand.
constexpr bool stands_aside(LandmarkKind kind) {
  return kind == LandmarkKind::mast || kind == LandmarkKind::platform;
}

/// Left is positive in both. What is in the middle, or not known to be aside, fits either side.
inline bool fits_aside(double seen_m, double mapped_m, bool measured = true) {
  constexpr double kClearSideM = 1.0;
  constexpr double kReachM = 1.5;         // a camera tells it to some 0.3 m
  constexpr double kAssumedReachM = 2.5;  // masts are not nearer than 2 m, and the track beside is not nearer than 3.5
  if (std::abs(seen_m) <= kClearSideM || std::abs(mapped_m) <= kClearSideM) return true;
  return std::abs(seen_m - mapped_m) < (measured ? kReachM : kAssumedReachM);
}

}  // namespace railfix::track
