// Which topics a program was made of, for who brings several releases together.
#pragma once

#include <cstdint>
#include <map>
#include <string>

namespace railfix::messaging {

/// A number for each IDL file, another one when it lays out its types otherwise: who has another number for a topic's
/// file does not hear it.
std::map<std::string, uint64_t> topic_layouts();

}  // namespace railfix::messaging
