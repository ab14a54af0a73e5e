#include "core/json_text.hpp"

#include <algorithm>

namespace railfix::core {

size_t json_depth(std::string_view text) {
  size_t depth = 0;
  size_t deepest = 0;
  bool in_string = false;
  for (size_t i = 0; i < text.size(); ++i) {
    const char c = text[i];
    if (c == '"') in_string = !in_string;
    if (in_string) {
      if (c == '\\') ++i;
    } else if (c == '[' || c == '{') {
      deepest = std::max(deepest, ++depth);
    } else if ((c == ']' || c == '}') && depth > 0) {
      --depth;
    }
  }
  return deepest;
}

Error not_json_at(std::string_view text, size_t byte) {
  if (text.find('\n') == std::string_view::npos) return {"not JSON at byte " + std::to_string(byte) + "."};
  const auto before = text.substr(0, byte == 0 ? 0 : byte - 1);
  const auto line = 1 + std::count(before.begin(), before.end(), '\n');
  const size_t column = before.size() - (before.rfind('\n') + 1);  // npos + 1 = 0
  return {"not JSON at line " + std::to_string(line) + ", column " + std::to_string(column + 1) + "."};
}

}  // namespace railfix::core
