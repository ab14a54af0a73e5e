// Writers and readers that are there and that this participant has nothing to do with, where one would expect it to.
#pragma once

#include <string>
#include <vector>

#include "messaging/messaging.hpp"

namespace railfix::messaging {

/// One sentence for each writer that is not heard, because a reader here asks for more than it offers; sorted.
std::vector<std::string> unheard_writers(Participant& participant);
/// One sentence for each reader that gets nothing of a writer here, because it shares no memory with it; sorted. One
/// that has just gone is not named.
std::vector<std::string> unreached_readers(Participant& participant);

}  // namespace railfix::messaging
