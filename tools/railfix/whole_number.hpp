// For options that count or seed: CLI11 takes -1 for the largest unsigned number there is.
#pragma once

#include <CLI/CLI.hpp>
#include <charconv>
#include <cstdint>
#include <limits>
#include <string>

namespace railfix::tool {

/// "a whole number from 0 on", or "from 1 to 10".
inline CLI::Validator whole_number(uint64_t least = 0, uint64_t most = std::numeric_limits<uint64_t>::max()) {
  const bool open = most == std::numeric_limits<uint64_t>::max();
  const std::string range = "from " + std::to_string(least) + (open ? " on" : " to " + std::to_string(most));
  return {[least, most, range](std::string& text) {
            uint64_t value = 0;
            const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
            const bool good =
                error == std::errc() && end == text.data() + text.size() && value >= least && value <= most;
            return good ? std::string() : text + " is not a whole number " + range;
          },
          range};
}

}  // namespace railfix::tool
