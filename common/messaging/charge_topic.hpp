// The topic on which services of one kind agree who is in charge: nobody else's business, so apart from topics.hpp.
#pragma once

#include "idl/charge.h"
#include "messaging/messaging.hpp"

namespace railfix::messaging::topics {

inline constexpr Topic<msg::InCharge> in_charge{
    "in_charge", "charge", {.reliable = false, .writer_reliable = false, .depth = 8}, 64};

}  // namespace railfix::messaging::topics
