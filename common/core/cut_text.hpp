// Text that must fit.
#pragma once

#include <cstddef>
#include <string>

namespace railfix::core {

/// At most so many bytes of UTF-8 text, cut between two characters.
inline std::string cut_text(std::string text, size_t most_bytes) {
  if (text.size() <= most_bytes) return text;
  const auto goes_on = [&](size_t at) { return (static_cast<unsigned char>(text[at]) & 0xC0U) == 0x80U; };
  while (most_bytes > 0 && goes_on(most_bytes)) --most_bytes;
  text.resize(most_bytes);
  return text;
}

}  // namespace railfix::core
