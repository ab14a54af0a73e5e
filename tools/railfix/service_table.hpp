// The services of a train as a table for the terminal.
#pragma once

#include <map>
#include <set>
#include <string>

#include "idl/operation.h"

namespace railfix::tool {

/// One line for each, with a header, in the order of the keys; their hosts when there are several. `silent` keys have
/// not been heard lately; they are so called unless they stopped in order. With colours: ANSI codes around what is
/// wrong.
std::string service_table(const std::map<std::string, msg::ServiceStatus>& services,
                          const std::set<std::string>& silent, bool colours);

}  // namespace railfix::tool
