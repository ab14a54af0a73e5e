// Asking for the address of a host without having to wait for a name server that does not answer.
#pragma once

#include <functional>
#include <string>

#include "core/result.hpp"

namespace railfix::ground_link {

/// Waits until the host's name is known to the system, or `stopped` says true (asked every 0.1 s). The system's call
/// cannot be ended: a thread that still waits for its answer is left behind. An error says why the name is not known.
core::Status look_up(const std::string& host, const std::function<bool()>& stopped);

}  // namespace railfix::ground_link
