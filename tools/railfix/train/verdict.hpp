// What `railfix train status` says of a computer as a whole: services that run may hear nothing.
#pragma once

#include <map>
#include <string>
#include <vector>

#include "service/health_file.hpp"
#include "train/plan.hpp"

namespace railfix::tool {

/// By service.
using Answers = std::map<std::string, service::HealthAnswer>;

/// Sentences of those that run and hear nothing, or nothing any more; none where data flow.
std::vector<std::string> deaf_services(const Answers& answers);

/// The standby's part at present, behind its text; empty for who is none.
std::string standby_text(const PlannedService& service, const service::HealthAnswer& health);

/// The other computers of the train, of which nothing is known here, and how to see them; empty when there are none.
std::string not_seen_from_here(const HostFolder& folder, const HostPlan& plan);

}  // namespace railfix::tool
