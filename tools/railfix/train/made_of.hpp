// Which topics (IDL) the programs of a train were made of: two that were made of different ones do not hear each other.
#pragma once

#include <map>
#include <optional>
#include <string>
#include <vector>

#include "train/plan.hpp"

namespace railfix::tool {

/// In what a program says to --check; empty when it says nothing of it.
TopicLayouts topic_layouts_in(const std::string& said);

/// "release 0.2.0 of fusion was made of other topics (position) than release 0.1.0 of tpr_publisher"; nothing when all
/// of both fit, as far as they say it.
std::optional<std::string> misfit(const std::vector<PlannedService>& those, const std::vector<PlannedService>& others);

}  // namespace railfix::tool
