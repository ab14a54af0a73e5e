// What a report says beside its place, where the two systems differ: counted, for nobody knows who is right.
#pragma once

#include <vector>

#include "compare/pairing.hpp"

namespace railfix::compare {

struct OtherFields {
  // Pairs in which our last report says another one than the certified.
  size_t modes = 0;         // M_MODE
  size_t levels = 0;        // M_LEVEL or NID_NTC
  size_t integrity = 0;     // Q_LENGTH
  size_t both_lengths = 0;  // both say L_TRAININT
  double longer_m = 0;      // ours then, on average; the way since our report counts
};

OtherFields other_fields_of(const std::vector<Pair>& pairs);

}  // namespace railfix::compare
