// Valid messages of every shape, and a way to change single fields of encoded ones. `Source` is what chooses, with
// next(): random numbers, or the input of a fuzzer.
#pragma once

#include "core/random.hpp"
#include "etcs/report_parameters.hpp"

namespace railfix::etcs::testing {

template <class Source>
uint32_t below(Source& random, uint32_t limit) {
  return static_cast<uint32_t>(random.next() % limit);
}

template <class Source>
TrainPositionReport random_report(Source& random, Baseline baseline) {
  const bool b4 = baseline == Baseline::b4;
  TrainPositionReport report;
  report.t_train = static_cast<uint32_t>(random.next());
  report.nid_engine = below(random, 1U << 24U);
  report.nid_packet = below(random, 2);
  report.q_scale = below(random, 3);
  report.nid_lrbg = below(random, 1U << 24U);
  if (report.nid_packet == 1) report.nid_prvlrbg = below(random, 1U << 24U);
  report.d_lrbg = below(random, 1U << 15U);
  report.q_dirlrbg = below(random, 3);
  report.q_dlrbg = below(random, 3);
  report.l_doubtover = below(random, 1U << 15U);
  report.l_doubtunder = below(random, 1U << 15U);
  report.q_length = below(random, 4);
  if (report.q_length == 1 || report.q_length == 2) report.l_trainint = below(random, 1U << 15U);
  report.v_train = below(random, b4 ? 122 : 121);
  if (report.v_train == 121) report.v_train = kStandstillSpeed;
  report.q_dirtrain = below(random, 3);
  report.m_mode = below(random, b4 ? 18 : 16);
  report.m_level = below(random, b4 ? 4 : 5);
  if (report.m_level == kLevelNtc) report.nid_ntc = below(random, 256);
  for (const uint32_t nid_packet : {44U, 4U, 44U, 5U}) {
    if (below(random, 3) != 0) continue;
    OtherPacket packet{nid_packet, {}};
    const uint32_t bits = nid_packet == 4 ? 8 : nid_packet == 5 ? 32 : 9 + below(random, 60);
    for (uint32_t i = 0; i < bits; ++i) packet.content.push_back(below(random, 2) == 1);
    report.other_packets.push_back(packet);
  }
  return report;
}

template <class Source>
ReportParameters random_parameters(Source& random) {
  ReportParameters parameters;
  parameters.q_dir = below(random, 3);
  parameters.q_scale = below(random, 3);
  parameters.t_cycloc = below(random, 256);
  parameters.d_cycloc = below(random, 32768);
  parameters.m_loc = below(random, 3);
  parameters.locations.resize(below(random, 32));
  for (auto& location : parameters.locations) {
    location.d_loc = below(random, 32768);
    location.q_lgtloc = below(random, 2);
  }
  return parameters;
}

/// Overwrites `count` bits from bit `begin`.
inline void set_bits(std::vector<uint8_t>& bytes, size_t begin, unsigned count, uint32_t value) {
  for (unsigned i = 0; i < count; ++i) {
    const size_t bit = begin + i;
    const auto mask = static_cast<uint8_t>(0x80U >> bit % 8);
    const bool one = (value >> (count - 1 - i) & 1U) != 0;
    bytes[bit / 8] = static_cast<uint8_t>(one ? bytes[bit / 8] | mask : bytes[bit / 8] & ~mask);
  }
}

}  // namespace railfix::etcs::testing
