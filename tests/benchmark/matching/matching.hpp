// The parts of railfix-measure-matching; each prints its figures.
#pragma once

#include <cstdint>
#include <string>

namespace railfix::measure {

struct MatchingOptions {
  int count = 0;  // 0 = what the figure asks for
  int from = 0;   // the first of them (locate)
  uint64_t seed = 1;
  std::string map;
  double track_km = 20000;   // of a made-up network
  double map_error_m = 0.5;  // of a track about the mapped one
  uint64_t elsewhere = 0;    // the trips are on another made-up network, of this seed (locate)
  bool astern = false;       // the trains back all the way (locate)
  double back_m = 0;         // after 1.5 km the trains set back so far, and go on (locate)
  bool other_leg = false;    // ... over another leg of a switch that they set back over
  bool gnss = false;         // where GNSS alone finds the train, too (locate)
  double masts_mapped = 1;   // share of the masts that the map has (landmarks)
  bool just_clear = false;   // all trains set back to a metre before the points, which are thrown (switches)
  std::string gyro_fault;    // all trains have a gyro alone that fails so 40 m before the points (switches)
  double fault_rps = 0;      // ... by so much
  bool each = false;         // a line for each ride that went wrong
};

int measure_switches(const MatchingOptions& options);
int measure_curvature(const MatchingOptions& options);
int measure_landmarks(const MatchingOptions& options);
int measure_locate(const MatchingOptions& options);

}  // namespace railfix::measure
