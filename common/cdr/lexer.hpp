// Private to this folder: an IDL text as words.
#pragma once

#include <string>
#include <string_view>
#include <vector>

namespace railfix::cdr {

struct Token {
  enum class Kind { word, number, sign, text, end };
  Kind kind = Kind::end;
  std::string text;  // words with their scope: "railfix::msg::TrackView"
  size_t line = 0;
  std::string comment;  // the comment that follows on the same line
};

/// Ends with one token of kind end. Signs that no IDL has become tokens too; the parser refuses them.
std::vector<Token> tokens_of(std::string_view text);

}  // namespace railfix::cdr
