// Words of the tables of a run, by the number of the message; for who writes and who reads them.
#pragma once

#include <array>

namespace railfix::tool {

inline constexpr std::array kModeWords{"search", "track", "keyframe", "blind"};
inline constexpr std::array kIntegrityWords{"ok", "degraded", "unusable"};

}  // namespace railfix::tool
