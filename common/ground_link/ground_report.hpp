// One position report on its way to the ground, as idl/ground_link.proto.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "core/result.hpp"

namespace railfix::ground_link {

struct GroundReport {
  std::string train;
  uint64_t stream = 0;
  uint64_t sequence = 0;
  int64_t stamp_ns = 0;
  int64_t sent_ns = 0;
  uint32_t baseline = 3;
  uint32_t reason = 0;
  std::vector<uint8_t> message;
  std::string host;
  bool operator==(const GroundReport&) const = default;
};

std::vector<uint8_t> to_bytes(const GroundReport& report);
/// Checks that the bytes are such a message, not that its ETCS message can be decoded.
core::Result<GroundReport> ground_report_from(std::span<const uint8_t> bytes);

}  // namespace railfix::ground_link
