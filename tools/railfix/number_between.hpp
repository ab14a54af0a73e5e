// For options that are numbers: CLI11's own range lets "nan" through.
#pragma once

#include <CLI/CLI.hpp>
#include <string>

namespace railfix::tool {

/// "a number from 0 to 1", or "a number of seconds from ...".
inline CLI::Validator number_between(double low, double high, const std::string& what = "a number") {
  const std::string from_to = CLI::detail::to_string(low) + " to " + CLI::detail::to_string(high);
  const std::string range = what + " from " + from_to;
  return {[low, high, range](std::string& text) {
            double value = 0;
            const bool good = CLI::detail::lexical_cast(text, value) && value >= low && value <= high;
            return good ? std::string() : text + " is not " + range;
          },
          from_to};
}

}  // namespace railfix::tool
