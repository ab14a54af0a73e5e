// The topic of the ETCS on-board unit: apart from topics.hpp, because one service only reads it and nobody of ours
// writes it.
#pragma once

#include "idl/onboard.h"
#include "messaging/messaging.hpp"

namespace railfix::messaging::topics {

inline constexpr Topic<msg::OnboardStatus> onboard_status{
    "onboard_status", "onboard", {.transient_local = true, .depth = 1}, 16};

}  // namespace railfix::messaging::topics
