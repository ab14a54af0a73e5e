#include "compare/other_fields.hpp"

namespace railfix::compare {

OtherFields other_fields_of(const std::vector<Pair>& pairs) {
  OtherFields found;
  for (const auto& pair : pairs) {
    const auto& ours = pair.ours_sent.fields;
    const auto& other = pair.certified.fields;
    found.modes += ours.m_mode != other.m_mode;
    found.levels += ours.m_level != other.m_level || ours.nid_ntc != other.nid_ntc;
    found.integrity += ours.q_length != other.q_length;
    if (!ours.l_trainint || !other.l_trainint) continue;
    ++found.both_lengths;
    const double since_m = pair.ours.running * (pair.ours.front_m - pair.ours_sent.front_m);
    found.longer_m += *ours.l_trainint + since_m - *other.l_trainint;
  }
  if (found.both_lengths > 0) found.longer_m /= static_cast<double>(found.both_lengths);
  return found;
}

}  // namespace railfix::compare
