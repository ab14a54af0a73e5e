// For options that are seconds: CLI11's own check names the largest number there is, all 309 digits of it.
#pragma once

#include <CLI/CLI.hpp>
#include <string>

namespace railfix::tool {

inline CLI::Validator not_negative() {
  return {[](std::string& text) {
            double value = 0;
            const bool good = CLI::detail::lexical_cast(text, value) && value >= 0;
            return good ? std::string() : text + " is not a number of seconds from 0 on";
          },
          "SECONDS"};
}

}  // namespace railfix::tool
