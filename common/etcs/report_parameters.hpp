// Packet 58 "Position report parameters" (trackside to train), bit-exact (SUBSET-026 7.4.2).
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "core/result.hpp"
#include "etcs/train_position_report.hpp"

namespace railfix::etcs {

constexpr uint32_t kNidPacketReportParameters = 58;
constexpr uint32_t kNoCycleTime = 255;        // T_CYCLOC: not cyclic in time
constexpr uint32_t kNoCycleDistance = 32767;  // D_CYCLOC: not cyclic in space

enum ReportAt : uint32_t { kReportNow = 0, kReportAtGroups = 1, kReportNotAtGroups = 2 };  // M_LOC

struct ReportLocation {
  uint32_t d_loc = 0;     // from the place before, x Q_SCALE
  uint32_t q_lgtloc = 1;  // 0 = min safe rear end, 1 = max safe front end passes it
  bool operator==(const ReportLocation&) const = default;
};

struct ReportParameters {
  uint32_t q_dir = 2;  // 0 reverse, 1 nominal, 2 both
  uint32_t q_scale = 1;
  uint32_t t_cycloc = kNoCycleTime;  // s
  uint32_t d_cycloc = kNoCycleDistance;
  uint32_t m_loc = kReportAtGroups;
  std::vector<ReportLocation> locations;  // up to 31
  bool operator==(const ReportParameters&) const = default;
};

/// L_PACKET.
uint32_t packet_bits(const ReportParameters& parameters);
/// The packet alone, padded with zeros to whole bytes.
core::Result<std::vector<uint8_t>> encode(const ReportParameters& parameters);
core::Result<ReportParameters> decode_report_parameters(std::span<const uint8_t> packet);
/// That takes spare values, too, and lists them.
core::Result<ReportParameters> decode_report_parameters_with_spare(std::span<const uint8_t> packet,
                                                                   std::vector<SpareValue>& spare);

}  // namespace railfix::etcs
