// Message types as their IDL text describes them, read at run time: what is needed to take a recorded or live sample
// apart without code generated for it. Understands the part of OMG IDL 4.2 that data types use: modules, constants,
// structures, enumerations, typedefs, bounded and unbounded strings and sequences, arrays. Of the annotations @key
// counts, those that change a sample's bytes (@optional, @bit_bound) are refused and the others skipped.
#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "core/result.hpp"

namespace railfix::cdr {

/// Modules, sequences, dimensions, and in samples structures with all of these: a hostile text must not exhaust the
/// stack.
inline constexpr size_t kDeepest = 32;

enum class Kind {
  boolean,
  octet,
  character,
  int8,
  int16,
  uint16,
  int32,
  uint32,
  int64,
  uint64,
  float32,
  float64,
  text,
  sequence,
  structure,
};

struct Structure;

struct Type {
  Kind kind = Kind::octet;
  uint64_t bound = 0;                    // of texts and sequences, 0 = none
  std::vector<uint64_t> dimensions;      // of arrays, empty = one value
  std::shared_ptr<const Type> element;   // of sequences
  const Structure* structure = nullptr;  // of structures; lives as long as its Types
};

struct Member {
  std::string name;
  Type type;
  bool key = false;
  std::string comment;    // what stands behind the member on its line
  std::string constants;  // "ODOMETRY_" when the comment names ODOMETRY_*: the constants that the value is one of
  bool bits = false;      // ... or is a sum of
};

struct Structure {
  std::string name;  // "railfix::msg::TrackView"
  std::vector<Member> members;
};

/// All types of one or more IDL texts. Not copyable: types point at each other.
class Types {
 public:
  Types() = default;
  Types(const Types&) = delete;
  Types& operator=(const Types&) = delete;
  Types(Types&&) = default;
  Types& operator=(Types&&) = default;

  /// Adds what the text defines. Error: "IDL line N: ..."; the types added before it stay.
  core::Status add(std::string_view idl_text);
  /// Nullptr when there is no such structure.
  [[nodiscard]] const Structure* find(const std::string& name) const;
  /// Constants by their full name ("railfix::msg::ODOMETRY_BLIND").
  [[nodiscard]] const std::map<std::string, int64_t>& constants() const { return constants_; }

 private:
  friend class Parser;
  std::map<std::string, std::unique_ptr<Structure>> structures_;
  std::map<std::string, Type> aliases_;  // typedefs and enumerations
  std::map<std::string, int64_t> constants_;
};

/// The types of all our own topics.
const Types& own_types();
/// The text of the file in idl/ that defines this type ("railfix::msg::TrackView"); empty when none does.
/// Self-contained, as MCAP's "omgidl" wants it.
std::string_view own_idl_of(const std::string& type_name);

}  // namespace railfix::cdr
