// Topics of a recording as people name them.
#pragma once

#include <string>
#include <vector>

#include "mcap/reader.hpp"

namespace railfix::tool {

/// One of the names is the topic, or stands before its first slash: "camera_frame" means all its cameras.
bool names_topic(const std::vector<std::string>& names, const std::string& topic);

/// Error: one of them names nothing that the recording has.
core::Status check_topics(const mcap::Reader& reader, const std::vector<std::string>& names);

/// The same of those that are to be left out: a topic of Railfix need not be there.
core::Status check_left_out(const mcap::Reader& reader, std::vector<std::string> names);

}  // namespace railfix::tool
