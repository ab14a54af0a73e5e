// What the recorder says of itself on recorder_status.
#pragma once

#include "recorder/recorder.hpp"

namespace railfix::recorder {

/// `quota_mb` 0 = none.
msg::RecorderStatus status_of(const RecorderState& state, const Survey& folder, double quota_mb);

/// Different in more than numbers that always grow: worth telling at once.
bool changed(const msg::RecorderStatus& before, const msg::RecorderStatus& now);

}  // namespace railfix::recorder
