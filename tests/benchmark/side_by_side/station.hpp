// Straight tracks side by side with crossovers between them: whatever turns and is passed there is much the same on all
// of them.
#pragma once

#include <memory>
#include <vector>

#include "core/random.hpp"
#include "track/map.hpp"
#include "track/ways.hpp"

namespace railfix::measure {

struct Crossover {
  int from = 0;  // track, counted from the left
  int to = 1;    // one beside it
  double at_m = 0;
};

struct StationPlan {
  int tracks = 2;
  double length_m = 12000;
  std::vector<Crossover> crossovers{};
  double mast_every_m = 0;    // the same beside all tracks; 0: none
  double balise_every_m = 0;  // pairs, on every track at places of its own
};

struct Station {
  std::shared_ptr<const track::Map> map;
  std::vector<std::vector<uint32_t>> edges;  // of each track, one behind the other
};

/// Northwards from 0, 4 m apart. A balise group lies at every pair of balises.
Station station(const StationPlan& plan, core::Random& random);

/// The way of a train that begins on a track, and takes every crossover that it meets with so much probability.
std::vector<track::Run> way_through(const Station& station, int track, double takes, core::Random& random);

}  // namespace railfix::measure
