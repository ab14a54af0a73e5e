#include "cdr/types.hpp"

#include <algorithm>
#include <charconv>
#include <limits>
#include <optional>

#include "cdr/lexer.hpp"
#include "idl/embedded_idl.hpp"

namespace railfix::cdr {

namespace {

struct SyntaxError {
  std::string message;
};

void refuse_beyond_deepest(size_t depth, const std::string& of_what) {
  if (depth > kDeepest) throw SyntaxError{"more than " + std::to_string(kDeepest) + " " + of_what};
}

size_t sequences_in(const Type& type) {
  size_t count = 0;
  for (const Type* one = &type; one->kind == Kind::sequence; one = one->element.get()) ++count;
  return count;
}

std::optional<Kind> simple_kind(const std::string& words) {
  static const std::map<std::string, Kind> kinds{{"boolean", Kind::boolean}, {"octet", Kind::octet},
                                                 {"uint8", Kind::octet},     {"char", Kind::character},
                                                 {"int8", Kind::int8},       {"short", Kind::int16},
                                                 {"int16", Kind::int16},     {"unsigned short", Kind::uint16},
                                                 {"uint16", Kind::uint16},   {"long", Kind::int32},
                                                 {"int32", Kind::int32},     {"unsigned long", Kind::uint32},
                                                 {"uint32", Kind::uint32},   {"long long", Kind::int64},
                                                 {"int64", Kind::int64},     {"unsigned long long", Kind::uint64},
                                                 {"uint64", Kind::uint64},   {"float", Kind::float32},
                                                 {"double", Kind::float64}};
  const auto found = kinds.find(words);
  return found == kinds.end() ? std::nullopt : std::optional(found->second);
}

/// "mode of work, ODOMETRY_* bits" names the constants "ODOMETRY_".
std::string constants_named(const std::string& comment) {
  const size_t star = comment.find("_*");
  if (star == std::string::npos) return "";
  size_t begin = star;
  while (begin > 0 && (std::isupper(static_cast<unsigned char>(comment[begin - 1])) != 0 || comment[begin - 1] == '_'))
    --begin;
  return comment.substr(begin, star + 1 - begin);
}

}  // namespace

class Parser {
 public:
  Parser(Types& types, std::string_view text) : types_(types), tokens_(tokens_of(text)) {}

  void run() {
    while (now().kind != Token::Kind::end) definition();
  }
  [[nodiscard]] size_t line() const { return now().line; }

 private:
  [[nodiscard]] const Token& now() const { return tokens_[position_]; }
  Token take() { return tokens_[position_ + 1 < tokens_.size() ? position_++ : position_]; }
  bool accept(const std::string& text) {
    if (now().text != text || now().kind == Token::Kind::text) return false;
    (void)take();
    return true;
  }
  Token expect(const std::string& text) {
    if (now().text != text) throw SyntaxError{"'" + text + "' expected in front of '" + now().text + "'"};
    return take();
  }
  std::string name() {
    if (now().kind != Token::Kind::word) throw SyntaxError{"a name expected in front of '" + now().text + "'"};
    return take().text;
  }
  [[nodiscard]] std::string full(const std::string& local) const {
    return scope_.empty() ? local : scope_ + "::" + local;
  }

  /// Looks the name up in this scope and then in every one around it.
  template <class Map>
  [[nodiscard]] typename Map::const_iterator resolve(const Map& map, const std::string& wanted) const {
    if (wanted.starts_with("::")) return map.find(wanted.substr(2));
    std::string scope = scope_;
    while (true) {
      std::string qualified = scope;
      if (!qualified.empty()) qualified.append("::");
      const auto found = map.find(qualified.append(wanted));
      if (found != map.end() || scope.empty()) return found;
      const size_t cut = scope.rfind("::");
      scope = cut == std::string::npos ? "" : scope.substr(0, cut);
    }
  }

  /// Gives whether one of the annotations is @key.
  bool annotations() {
    bool key = false;
    while (accept("@")) {
      const std::string annotation = name();
      if (annotation == "optional" || annotation == "bit_bound") {
        throw SyntaxError{"@" + annotation + " is not supported; it changes how the samples are laid out"};
      }
      key = annotation == "key" || key;
      if (!accept("(")) continue;
      for (int depth = 1; depth > 0;) {
        if (now().kind == Token::Kind::end) throw SyntaxError{"an annotation does not end"};
        const std::string sign = take().text;
        depth += sign == "(" ? 1 : sign == ")" ? -1 : 0;
      }
    }
    return key;
  }

  void definition() {
    (void)annotations();
    const std::string what = name();
    if (what == "module") {
      module();
    } else if (what == "const") {
      constant();
    } else if (what == "struct") {
      structure();
    } else if (what == "enum") {
      enumeration();
    } else if (what == "typedef") {
      const Type type = type_name();
      const std::string alias = full(name());
      types_.aliases_[alias] = array_of(type);
    } else {
      throw SyntaxError{"'" + what + "' is not understood; module, const, struct, enum or typedef expected"};
    }
    (void)expect(";");
  }

  void module() {
    refuse_beyond_deepest(++depth_, "modules stand in each other");
    const std::string outer = scope_;
    scope_ = full(name());
    (void)expect("{");
    while (!accept("}")) definition();
    scope_ = outer;
    --depth_;
  }

  void constant() {
    if (accept("string")) {
      (void)name();
      (void)expect("=");
      (void)take();
      return;
    }
    const Kind kind = type_name().kind;
    const std::string constant_name = full(name());
    (void)expect("=");
    if (kind == Kind::float32 || kind == Kind::float64) {
      (void)accept("-");
      (void)take();
    } else {
      types_.constants_[constant_name] = integer();
    }
  }

  int64_t integer() {
    const bool negative = accept("-");
    const Token token = take();
    if (token.kind == Token::Kind::word) {
      if (token.text == "TRUE" || token.text == "FALSE") return token.text == "TRUE" ? 1 : 0;
      const auto known = resolve(types_.constants_, token.text);
      if (known == types_.constants_.end()) throw SyntaxError{"constant '" + token.text + "' is not defined"};
      return negative ? -known->second : known->second;
    }
    const bool hex = token.text.starts_with("0x") || token.text.starts_with("0X");
    const char* begin = token.text.data() + (hex ? 2 : 0);
    const char* end = token.text.data() + token.text.size();
    int64_t value = 0;
    const auto [stop, error] = std::from_chars(begin, end, value, hex ? 16 : 10);
    if (token.kind != Token::Kind::number || error != std::errc() || stop != end) {
      throw SyntaxError{"an integer expected instead of '" + token.text + "'"};
    }
    return negative ? -value : value;
  }

  uint64_t size() {
    const int64_t value = integer();
    if (value <= 0 || value > std::numeric_limits<uint32_t>::max()) {
      throw SyntaxError{"a size of " + std::to_string(value) + " is not possible"};
    }
    return static_cast<uint64_t>(value);
  }

  /// The type with the dimensions that stand here; those of a typedef that is an array itself are the inner ones.
  Type array_of(Type type) {
    std::vector<uint64_t> all;
    while (accept("[")) {
      all.push_back(size());
      (void)expect("]");
    }
    all.insert(all.end(), type.dimensions.begin(), type.dimensions.end());
    refuse_beyond_deepest(all.size(), "dimensions in one array");
    type.dimensions = std::move(all);
    return type;
  }

  std::shared_ptr<const Type> element() {
    (void)expect("<");
    refuse_beyond_deepest(++depth_, "sequences stand in each other");
    auto type = std::make_shared<const Type>(type_name());
    refuse_beyond_deepest(sequences_in(*type) + 1, "sequences stand in each other");  // typedefs hide them
    --depth_;
    return type;
  }

  Type type_name() {
    std::string words = name();
    if (words == "unsigned") words += " " + name();
    if (words.ends_with("long") && accept("long")) words += " long";
    Type type;
    if (const auto kind = simple_kind(words)) {
      type.kind = *kind;
      return type;
    }
    if (words == "string" || words == "sequence") {
      type.kind = words == "string" ? Kind::text : Kind::sequence;
      if (type.kind == Kind::sequence) {
        type.element = element();
        if (accept(",")) type.bound = size();
        (void)expect(">");
      } else if (accept("<")) {
        type.bound = size();
        (void)expect(">");
      }
      return type;
    }
    if (const auto known = resolve(types_.structures_, words); known != types_.structures_.end()) {
      type.kind = Kind::structure;
      type.structure = known->second.get();
      return type;
    }
    const auto alias = resolve(types_.aliases_, words);
    if (alias == types_.aliases_.end()) throw SyntaxError{"type '" + words + "' is not defined or not supported"};
    return alias->second;
  }

  void enumeration() {
    const std::string enum_name = full(name());
    (void)expect("{");
    int64_t value = 0;
    do {
      (void)annotations();
      types_.constants_[full(name())] = value++;
    } while (accept(","));
    (void)expect("}");
    Type type;
    type.kind = Kind::int32;
    types_.aliases_[enum_name] = type;
  }

  void structure() {
    auto made = std::make_unique<Structure>();
    made->name = full(name());
    if (accept(":")) throw SyntaxError{"structures with a base are not supported"};
    (void)expect("{");
    while (!accept("}")) member(*made);
    if (made->members.empty()) throw SyntaxError{"structure " + made->name + " has no members"};
    const std::string key = made->name;
    // A text read twice may define the same type again; what points at the first stays right.
    types_.structures_.try_emplace(key, std::move(made));
  }

  void member(Structure& into) {
    const bool key = annotations();
    const Type type = type_name();
    const size_t first = into.members.size();
    do {
      const std::string member_name = name();
      into.members.push_back({member_name, array_of(type), key, "", "", false});
    } while (accept(","));
    const std::string comment = expect(";").comment;
    for (size_t i = first; i < into.members.size(); ++i) {
      into.members[i].comment = comment;
      into.members[i].constants = constants_named(comment);
      into.members[i].bits = comment.find("bits") != std::string::npos;
    }
  }

  Types& types_;
  std::vector<Token> tokens_;
  size_t position_ = 0;
  std::string scope_;
  size_t depth_ = 0;  // of modules and sequences around this place
};

core::Status Types::add(std::string_view idl_text) {
  Parser parser(*this, idl_text);
  try {
    parser.run();
  } catch (const SyntaxError& error) {
    return core::Error{"IDL line " + std::to_string(parser.line()) + ": " + error.message};
  }
  return {};
}

const Structure* Types::find(const std::string& name) const {
  const auto found = structures_.find(name);
  return found == structures_.end() ? nullptr : found->second.get();
}

const Types& own_types() {
  static const Types types = [] {
    Types made;
    for (const auto& file : idl::kEmbeddedIdl) core::ok_or_throw(made.add(file.text));
    return made;
  }();
  return types;
}

std::string_view own_idl_of(const std::string& type_name) {
  static const auto files = [] {
    std::vector<std::pair<Types, std::string_view>> made;
    for (const auto& file : idl::kEmbeddedIdl) {
      made.emplace_back(Types(), file.text);
      core::ok_or_throw(made.back().first.add(file.text));
    }
    return made;
  }();
  for (const auto& [types, text] : files) {
    if (types.find(type_name) != nullptr) return text;
  }
  return {};
}

}  // namespace railfix::cdr
