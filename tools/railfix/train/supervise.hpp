// Keeps the services of one host running as its plan says: the only thing that systemd, or a person, starts on a host.
#pragma once

#include "train/plan.hpp"

namespace railfix::tool {

/// Until SIGTERM or SIGINT. Follows the plan when it changes: services whose entry has changed are stopped and started
/// anew, those that are gone are stopped. It waits for none of them: the others are looked after while one does not
/// end; what is to be started in its place waits, unless it was killed and the kernel holds it. One that ends by itself
/// is started again after 0.2 s, later and later (up to 5 s) when it does not live; one whose run loop has not turned
/// for 3 s is killed first. What killed ones leave in /dev/shm is removed. Throws BadInput when another supervisor has
/// this folder.
void supervise(const HostFolder& folder);

/// Whether a supervisor has this folder; its process.
std::optional<int64_t> supervisor_of(const HostFolder& folder);

}  // namespace railfix::tool
