// What the track detector told of a picture over DDS, as it may be drawn.
#pragma once

#include "idl/track.h"
#include "track_detector/draw.hpp"

namespace railfix::tool {

inline constexpr double kGaugeM = 1.435;

/// The message leaves out how far the rails were followed and the change of curvature; its edge points still show both.
track_detector::TrackObservation observation_of(const msg::TrackView& view, const geometry::Intrinsics& camera);

}  // namespace railfix::tool
