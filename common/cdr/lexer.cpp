#include "cdr/lexer.hpp"

#include <cctype>

namespace railfix::cdr {

namespace {

bool is_word(char c) {
  return std::isalnum(static_cast<unsigned char>(c)) != 0 || c == '_';
}
bool is_digit(char c) {
  return std::isdigit(static_cast<unsigned char>(c)) != 0;
}
bool is_space(char c) {
  return std::isspace(static_cast<unsigned char>(c)) != 0;
}

class Lexer {
 public:
  explicit Lexer(std::string_view text) : text_(text) {}

  std::vector<Token> run() {
    while (position_ < text_.size()) step();
    tokens_.push_back({Token::Kind::end, "end of the text", line_, ""});
    return std::move(tokens_);
  }

 private:
  [[nodiscard]] bool at(std::string_view what) const { return text_.substr(position_, what.size()) == what; }

  std::string_view until(std::string_view what) {
    const size_t end = std::min(text_.find(what, position_), text_.size());
    const std::string_view passed = text_.substr(position_, end - position_);
    position_ = end;
    return passed;
  }

  template <class Test>
  std::string take(Test test) {
    const size_t begin = position_;
    while (position_ < text_.size() && test(text_[position_])) ++position_;
    return std::string(text_.substr(begin, position_ - begin));
  }

  void step() {
    const char c = text_[position_];
    if (c == '\n') {
      ++line_;
      ++position_;
    } else if (is_space(c)) {
      ++position_;
    } else if (at("//")) {
      comment(until("\n").substr(2));
    } else if (at("/*")) {
      for (const char inside : until("*/")) line_ += inside == '\n' ? 1 : 0;
      position_ = std::min(position_ + 2, text_.size());
    } else if (c == '#') {
      until("\n");
    } else if (c == '"') {
      ++position_;
      add(Token::Kind::text, std::string(until("\"")));
      position_ = std::min(position_ + 1, text_.size());
    } else if (is_digit(c)) {
      add(Token::Kind::number, take([](char x) { return is_word(x) || x == '.'; }));
    } else if (is_word(c) || at("::")) {
      add(Token::Kind::word, scoped_name());
    } else {
      add(Token::Kind::sign, std::string(1, c));
      ++position_;
    }
  }

  std::string scoped_name() {
    std::string name;
    while (position_ < text_.size() && (is_word(text_[position_]) || at("::"))) {
      if (at("::")) {
        name += "::";
        position_ += 2;
      } else {
        name += take(is_word);
      }
    }
    return name;
  }

  void comment(std::string_view what) {
    while (!what.empty() && is_space(what.front())) what.remove_prefix(1);
    while (!what.empty() && is_space(what.back())) what.remove_suffix(1);
    if (!tokens_.empty() && tokens_.back().line == line_) tokens_.back().comment = what;
  }

  void add(Token::Kind kind, std::string text) { tokens_.push_back({kind, std::move(text), line_, ""}); }

  std::string_view text_;
  size_t position_ = 0;
  size_t line_ = 1;
  std::vector<Token> tokens_;
};

}  // namespace

std::vector<Token> tokens_of(std::string_view text) {
  return Lexer(text).run();
}

}  // namespace railfix::cdr
