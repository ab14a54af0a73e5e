// JSON as text. Of what comes from a file or the network errors say where, and what nests without end is refused,
// because to copy or print it would exhaust the stack.
#pragma once

#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <string_view>

#include "core/result.hpp"

namespace railfix::core {

constexpr size_t kDeepestJson = 64;  // GeoJSON takes 9, the rest less

/// Objects and lists that are open at once, at most. Counted before the parser sees the text: its own callback takes
/// quadratic time over a long list.
size_t json_depth(std::string_view text);
/// "not JSON at line 3, column 7.", or "not JSON at byte 7." of a text that is one line; `byte` counts from 1.
Error not_json_at(std::string_view text, size_t byte);

/// The first key that an object has twice: of two values the parser keeps the last, silently. REQUIRES: JSON.
std::optional<std::string> repeated_key(std::string_view text);

template <class Json = nlohmann::json>
Result<Json> parse_json(std::string_view text) {
  if (json_depth(text) > kDeepestJson)
    return Error{"its lists and objects nest more than " + std::to_string(kDeepestJson) + " deep."};
  try {
    return Json::parse(text);
  } catch (const nlohmann::json::parse_error& error) {
    return not_json_at(text, error.byte);
  } catch (const nlohmann::json::out_of_range&) {
    return Error{"a number in it is too large."};
  }
}

/// For what people write, where a key that is there twice is a mistake; it takes a second pass over the text.
template <class Json = nlohmann::json>
Result<Json> parse_json_strictly(std::string_view text) {
  auto json = parse_json<Json>(text);
  if (!json.ok()) return json;
  if (const auto key = repeated_key(text)) return Error{"the key \"" + *key + "\" is there twice in one object."};
  return json;
}

/// For who reads on: names and sentences of others may be broken UTF-8, at which dump() throws. No indent: one line.
template <class Json>
std::string json_text(const Json& json, int indent = -1) {
  return json.dump(indent, ' ', false, Json::error_handler_t::replace);
}

}  // namespace railfix::core
