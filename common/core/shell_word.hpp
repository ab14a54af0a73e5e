// Commands that a person pastes.
#pragma once

#include <algorithm>
#include <cctype>
#include <string>

namespace railfix::core {

/// In quotes where the shell would take it for more than one word, or for something else.
inline std::string shell_word(const std::string& text) {
  const auto is_plain = [](unsigned char c) {
    return std::isalnum(c) != 0 || c >= 0x80 ||
           std::string("_-./:@%+=,").find(static_cast<char>(c)) != std::string::npos;
  };
  if (!text.empty() && std::ranges::all_of(text, is_plain)) return text;
  std::string quoted = "'";
  for (const char c : text) quoted += c == '\'' ? "'\\''" : std::string(1, c);
  return quoted + "'";
}

}  // namespace railfix::core
