// A part of a recording as the user names it: in seconds from its beginning.
#pragma once

#include "core/result.hpp"
#include "mcap/reader.hpp"

namespace railfix::tool {

/// All topics from `from_s` to `to_s`, exclusive; infinite = to the end. Error: the part is empty or lies behind the
/// end.
core::Result<mcap::Selection> part_in_time(const mcap::Reader& reader, double from_s, double to_s);

}  // namespace railfix::tool
