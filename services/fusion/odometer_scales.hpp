// What is known of the scales of camera and wheel: true over measured metres, less 1. A train has driven before: they
// are kept from trip to trip, and known the worse the longer ago that was.
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "core/result.hpp"
#include "fusion/camera_lag.hpp"
#include "fusion/fusion_parameters.hpp"

namespace railfix::fusion {

struct OdometerScales {
  double camera = 0;
  double wheel = 0;
  double camera_sigma = 0;
  double wheel_sigma = 0;
  double correlation = 0;  // of the two errors: the same references taught both
};

/// Before any reference has told more.
OdometerScales unlearnt_scales(const FusionParameters& parameters);

/// What an earlier trip has taught, and the sensors that it is true of.
struct SavedScales {
  OdometerScales scales;
  int64_t stamp_ns = 0;         // of the data that taught it
  std::string camera_id;        // its calibration; empty = not known
  double pulses_per_metre = 0;  // 0 = no wheel
  std::optional<CameraLag::Lag> camera_lag;
};

/// A line each, `key: value` (YAML).
std::string to_text(const SavedScales& saved);
/// Fails on text that to_text did not write to its end, or on numbers that no odometer has; says what is wrong with it.
core::Result<SavedScales> saved_scales(const std::string& text);

/// At the begin of a trip at that time: lens, load and wear have changed them meanwhile.
OdometerScales aged(const SavedScales& saved, int64_t stamp_ns, const FusionParameters& parameters);

}  // namespace railfix::fusion
