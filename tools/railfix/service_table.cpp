#include "service_table.hpp"

#include <spdlog/fmt/fmt.h>

#include <algorithm>
#include <functional>
#include <set>

#include "messaging/message_words.hpp"

namespace railfix::tool {

namespace {

const char* colour_of(uint8_t state, bool silent) {
  if (silent || state == msg::STATE_FAILED) return "\x1b[31m";
  if (state == msg::STATE_DEGRADED) return "\x1b[33m";
  return state == msg::STATE_ACTIVE ? "\x1b[32m" : "";
}

/// Gives a host as a column of the table, or nothing where all services are on one.
std::function<std::string(const std::string&)> host_column_of(const messaging::ServiceBoard& board) {
  std::set<std::string> hosts;
  size_t width = std::string("host").size();
  for (const auto& [key, seen] : board.services()) {
    hosts.insert(key.first);
    width = std::max(width, key.first.size());
  }
  if (hosts.size() < 2) return [](const std::string&) { return std::string(); };
  return [width](const std::string& host) { return fmt::format("{:<{}} ", host, width); };
}

}  // namespace

std::string service_table(const messaging::ServiceBoard& board, bool colours) {
  const auto host_column = host_column_of(board);
  std::string text =
      fmt::format("{:<15} {}{:<9} {:>8} {:>8} {:>8} {:>8} {:>8} {:>6} {:>7}  {}\n", "service", host_column("host"),
                  "state", "in", "out", "dropped", "p50 ms", "p99 ms", "cpu %", "MB", "reason");
  for (const auto& [key, seen] : board.services()) {
    const auto& s = seen.status;
    const bool quiet = !seen.stopped() && !seen.alive;
    const std::string state = fmt::format("{:<9}", quiet ? "SILENT" : messaging::name_of_state(s.state()));
    text +=
        fmt::format("{:<15} {}{} {:>8} {:>8} {:>8} {:>8.1f} {:>8.1f} {:>6.1f} {:>7.1f}  {}\n", s.service().c_str(),
                    host_column(s.host().c_str()), colours ? colour_of(s.state(), quiet) + state + "\x1b[0m" : state,
                    s.frames_in(), s.frames_out(), s.dropped(), s.latency_p50_ms(), s.latency_p99_ms(), s.cpu_percent(),
                    s.rss_mb(), s.reason().c_str());
  }
  return text;
}

}  // namespace railfix::tool
