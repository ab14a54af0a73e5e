// What is drawn over the camera picture: rails as the track detector saw them, landmarks where the map and the position
// put them. Pixels are those of the preview picture. Knows no DDS reader.
#pragma once

#include <nlohmann/json.hpp>
#include <string>

#include "geometry/camera.hpp"
#include "idl/camera.h"
#include "idl/track.h"
#include "monitor/map_view.hpp"

namespace railfix::monitor {

struct CabView {
  std::string camera;
  int64_t stamp_ns = 0;
  uint32_t width_px = 0;  // of the preview
  uint32_t height_px = 0;
  uint32_t health = 0;                               // PICTURE_* bits
  const msg::TrackView* track = nullptr;             // of this picture; null = none came
  const geometry::Intrinsics* intrinsics = nullptr;  // of the full picture; null = not known yet
  const MapView* map = nullptr;
  std::optional<track::EdgePosition> train;  // where the track is known
};

/// The message `view` of /api/live.
nlohmann::json view_message(const CabView& view);

}  // namespace railfix::monitor
