// The services of a train as a table for the terminal.
#pragma once

#include <string>

#include "messaging/service_board.hpp"

namespace railfix::tool {

/// One line for each, with a header, by host and name; their hosts when there are several. Who has not been heard
/// lately is called silent, unless it stopped in order. With colours: ANSI codes around what is wrong.
std::string service_table(const messaging::ServiceBoard& board, bool colours);

}  // namespace railfix::tool
