// Which topics each service may write and read: the basis of the permissions of DDS Security. A test compares it with
// what the services do.
#pragma once

#include <string>
#include <vector>

namespace railfix::tool {

/// Topic expressions (DDS-SEC 1.1, 9.4.1.2.7: "*" stands for an instance) beside those that every service writes.
const std::vector<std::string>& topics_written_by(const std::string& service);
/// Those that it reads, and its own: a standby hears the first one. "*" = every topic.
std::vector<std::string> topics_read_by(const std::string& service);
/// By every service: status, log, answers and its turn in lock step.
const std::vector<std::string>& topics_written_by_all();

/// Identity of a person at `railfix topics`, `recording`, `train`: reads everything and writes commands.
inline constexpr const char* kOperator = "tool";

}  // namespace railfix::tool
