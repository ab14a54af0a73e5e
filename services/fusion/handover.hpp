// What one fusion can take over from another: from the one in charge when it stands by, from the one before it when it
// is started anew.
#pragma once

#include <memory>
#include <optional>

#include "fusion/fusion_types.hpp"
#include "track/map.hpp"

namespace railfix::fusion {

/// What is known for longer than that says nothing of where the train is now.
inline constexpr double kOldestPlaceS = 30.0;

/// A train_state as far as it matters here.
struct KnownPlace {
  int64_t stamp_ns = 0;
  track::EdgePosition position;
  double speed_mps = 0;  // along the cab's forward axis; NaN = not known
  double over_m = 0;
  double under_m = 0;
  double track_probability = 0;
  bool only_told = false;
  bool in_doubt = false;
  track::PlanPose pose{};  // of the cab, on the map of who says it; 0, 0 = not told
};

/// That place as a network fix at a later time: moved on with its speed, and as uncertain as that makes it, so that an
/// interval of `interval_factor` sigma holds the train. Nothing when it is too old, speed or track are not known, it is
/// of another map, or a switch may have led the train elsewhere meanwhile. One that something spoke against stays in
/// doubt: who that was is not handed over.
std::optional<FixInput> place_at(const std::shared_ptr<const track::Map>& map, const KnownPlace& known,
                                 int64_t stamp_ns, double interval_factor);

}  // namespace railfix::fusion
