// Writers that are there and that this participant does not hear, because its readers ask for more than they offer.
#pragma once

#include <string>
#include <vector>

#include "messaging/messaging.hpp"

namespace railfix::messaging {

/// One sentence for each such pair now, sorted.
std::vector<std::string> unheard_writers(Participant& participant);

}  // namespace railfix::messaging
