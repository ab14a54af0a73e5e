// Words for the numbers of messages, the same on every page, table and metric.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

namespace railfix::messaging {

/// By ServiceStatus.state.
inline constexpr std::array kStateNames{"starting", "ready", "active", "degraded", "failed", "stopped"};
/// By LogRecord.level.
inline constexpr std::array kLevelNames{"trace", "debug", "info", "warning", "error", "critical"};

/// By TrainState.integrity.
inline constexpr std::array kIntegrityNames{"ok", "degraded", "unusable"};
/// By OdometryStep.mode.
inline constexpr std::array kOdometryModeNames{"search", "track", "keyframe", "blind"};
/// By bit of CameraFrame.health, the lowest first (PICTURE_* in idl/camera.idl).
inline constexpr std::array kPictureHealthNames{"dark", "saturated", "frozen", "out of order", "covered", "blurred"};

/// A state that a later release may have is "stopped".
constexpr const char* name_of_state(uint8_t state) {
  return kStateNames[std::min<size_t>(state, kStateNames.size() - 1)];
}
/// ... and an integrity "unusable".
constexpr const char* name_of_integrity(uint8_t integrity) {
  return kIntegrityNames[std::min<size_t>(integrity, kIntegrityNames.size() - 1)];
}
constexpr const char* name_of_level(uint8_t level) {
  return kLevelNames[std::min<size_t>(level, kLevelNames.size() - 1)];
}
/// None for 0.
inline std::vector<std::string> names_of_picture_health(uint32_t health) {
  std::vector<std::string> names;
  for (size_t bit = 0; bit < kPictureHealthNames.size(); ++bit) {
    if ((health >> bit & 1U) != 0) names.emplace_back(kPictureHealthNames[bit]);
  }
  return names;
}

}  // namespace railfix::messaging
