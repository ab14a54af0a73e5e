// Position reports on the groups of balise_map().
#pragma once

#include <cmath>

#include "compare/pairing.hpp"
#include "core/time.hpp"
#include "unit/tpr_publisher/balise_map.hpp"

namespace railfix::compare::testing {

using namespace tpr_publisher::testing;  // NOLINT(google-build-using-namespace)

/// `front_m` beyond the group, along its nominal direction; the train looks and runs `along` it or against it.
inline TimedReport report(double run_s, uint32_t group, double front_m, double speed_kmh = 72, bool along = true) {
  TimedReport timed;
  timed.stamp_ns = core::to_ns(run_s);
  auto& f = timed.fields;
  f.nid_lrbg = group;
  f.q_scale = 0;
  f.d_lrbg = static_cast<uint32_t>(std::lround(std::abs(front_m) * 10));
  f.q_dlrbg = front_m >= 0 ? etcs::kNominal : etcs::kReverse;
  f.q_dirlrbg = f.q_dirtrain = along ? etcs::kNominal : etcs::kReverse;
  f.l_doubtover = 30;
  f.l_doubtunder = 70;
  f.v_train = static_cast<uint32_t>(std::lround(speed_kmh / 5));
  return timed;
}

/// Packet 1: `nominal` is the way from the group before.
inline TimedReport report_from(uint32_t before, TimedReport report) {
  report.fields.nid_packet = 1;
  report.fields.nid_prvlrbg = before;
  return report;
}

inline TimedReport lost(double run_s) {
  auto unknown = report(run_s, etcs::kUnknownBaliseGroup, 0);
  unknown.fields.d_lrbg = etcs::kUnknownDistance;
  return unknown;
}

constexpr int64_t kGapNs = 15 * core::kNsPerSecond;

}  // namespace railfix::compare::testing
