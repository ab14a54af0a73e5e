// This computer on the network: which addresses DDS may use, and who shares memory with this process.
#pragma once

#include <string>
#include <vector>

#include "core/result.hpp"

namespace railfix::messaging {

/// IPv4 addresses of these interfaces, each given by name ("eth0") or by its address; the loopback address is added,
/// because services of one host need it. An empty list stays empty (all interfaces). Error: an interface that this
/// computer does not have or that has no IPv4 address, with the ones that it has.
core::Result<std::vector<std::string>> addresses_of(const std::vector<std::string>& interfaces);

/// "eth0 (10.42.1.12), lo (127.0.0.1)": what this computer has.
std::string interfaces_told();

/// How many of these interfaces have a carrier: Fast DDS 2.9 uses no others, and those that come later it never uses.
size_t running_interfaces(const std::vector<std::string>& interfaces);

/// Equal for the processes that can share memory over Fast DDS: one boot of one computer and one network namespace
/// (Fast DDS tells hosts by their addresses). Sixteen letters and digits.
std::string memory_id();

}  // namespace railfix::messaging
