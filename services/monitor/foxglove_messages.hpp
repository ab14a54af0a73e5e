// The channels that Foxglove viewers see: every topic as it is (cdr, with its IDL), and what their panels draw by
// themselves - pictures, rails on pictures, the place on a map, the log (protobuf).
#pragma once

#include <nlohmann/json.hpp>
#include <set>
#include <string>
#include <vector>

#include "idl/camera.h"
#include "idl/operation.h"
#include "idl/pose.h"
#include "idl/position.h"
#include "monitor/foxglove_api.hpp"

namespace railfix::monitor {

inline constexpr const char* kFoxglovePlace = "place";
inline constexpr const char* kFoxgloveLog = "log";
inline std::string foxglove_picture(const std::string& camera) {
  return "picture/" + camera;
}
inline std::string foxglove_rails(const std::string& camera) {
  return "rails/" + camera;
}

/// A DDS topic as a channel.
FoxgloveChannel cdr_channel(const std::string& topic, const std::string& type, const std::string& idl);
/// The drawn ones.
std::vector<FoxgloveChannel> drawn_channels(const std::set<std::string>& cameras);

std::string compressed_image(const msg::CameraPreview& preview, const std::string& camera);
/// `view`: the message of /api/live for this picture.
std::string image_annotations(const nlohmann::json& view);
/// Empty where the map has no geographic coordinates. `pose` may be null.
std::string location_fix(const msg::TrainState& state, const msg::TrainPose* pose);
std::string foxglove_log(const msg::LogRecord& record);

}  // namespace railfix::monitor
