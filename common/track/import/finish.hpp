// What is added to a connected map, and the check of it.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "core/result.hpp"
#include "track/map.hpp"

namespace railfix::track {

/// Puts a frog on both branches of every switch from node `first` on (an index of map.nodes), where the gauge faces of
/// the inner rails cross; sigma_m says how well the source knows the place.
void add_frogs(Map& map, double sigma_m, size_t first = 0);

/// What virtual balise groups are called: by one NID_C after the other, as one has 16,382 of them at most.
struct GroupNumbers {
  std::vector<uint32_t> nid_c{1};
  uint32_t first_nid_bg = 1;  // of the first NID_C; the others begin at 1
};

struct VirtualBalises {
  double every_m = 0;  // 0 = none were asked for
  size_t groups = 0;
  size_t short_edges = 0;  // than half of that: they have none
  double short_m = 0;      // together
  [[nodiscard]] bool was_asked_for() const { return every_m > 0 || groups > 0; }
};

/// Virtual balise groups about every `every_m` along every edge (none on edges shorter than half of it, none within 10
/// m of a group that is there already), with the numbers that no group of the map has. Fails when these run out, and
/// adds none then.
core::Result<VirtualBalises> add_virtual_balises(Map& map, double every_m, const GroupNumbers& numbers,
                                                 double q_locacc_m);

/// Virtual balise groups at these places ("EDGE:OFFSET"; nominal against growing offsets with ":-" behind it). Fails
/// where one is none of the map, has a group within 10 m, or when numbers run out, and adds none then.
core::Status add_virtual_balises_at(Map& map, const std::vector<std::string>& places, const GroupNumbers& numbers,
                                    double q_locacc_m);

/// Leaves out landmarks of other kinds than these; the others get new numbers. Balise groups keep the number of
/// their balises, because one of a single balise is reported otherwise (ETCS packet 1). Fails when there is no such
/// kind.
core::Status keep_landmarks(Map& map, const std::vector<std::string>& kinds);

/// What is wrong with the map, one sentence each, naming the element. First what cuts the network: gaps, switches that
/// lead nowhere, track ends that just miss another or face it over a gap, balise groups with one identity or at one
/// place, parts that are not connected. Then kinks and impossible radii, grades and cant; of many radii and kinks the
/// worst by name, the others counted.
std::vector<std::string> check_topology(const Map& map);

}  // namespace railfix::track
