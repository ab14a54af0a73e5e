// Which services of this host run, whoever has started them.
#pragma once

#include "train/plan.hpp"

namespace railfix::tool {

/// Of those that `noted` names the ones that still run; and everything else on this computer whose command line is that
/// of a service in the plan or in a generation: after a supervisor that died, state.yaml may be old, damaged or gone,
/// and nothing may run twice. Under its service's name stands one, and with kBefore the one that it succeeds; what is
/// too many stands with kTooMany.
HostState running_on(const HostFolder& folder, const HostState& noted);
inline constexpr const char* kTooMany = " too many ";
/// Of these keys.
std::string service_of(const std::string& key);

/// Without --beside, which only its start had.
std::vector<std::string> usual_command(std::vector<std::string> command);

}  // namespace railfix::tool
