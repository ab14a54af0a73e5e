// Which services of this host run, whoever has started them.
#pragma once

#include "train/plan.hpp"

namespace railfix::tool {

/// Of those that `noted` names the ones that still run; and everything else on this computer whose command line is that
/// of a service in the plan or in a generation: after a supervisor that died, state.yaml may be old, damaged or gone,
/// and nothing may run twice. Of two of one service the younger stands under its name, as successor if it is one.
HostState running_on(const HostFolder& folder, const HostState& noted);

/// Without --beside, which only its start had.
std::vector<std::string> usual_command(std::vector<std::string> command);

}  // namespace railfix::tool
