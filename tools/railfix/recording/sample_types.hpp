// What a recorded sample says of itself, read with the types that stand in the recording: recordings of other versions
// can be read too.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>

#include "cdr/types.hpp"
#include "mcap/reader.hpp"

namespace railfix::tool {

class SampleTypes {
 public:
  /// REQUIRES: the reader outlives it.
  explicit SampleTypes(const mcap::Reader& reader) : reader_(reader) {}

  /// The types that describe this channel's samples: the recording's own, else those of this version. Nullptr when
  /// neither knows the channel's type.
  const cdr::Types* types(const mcap::Channel& channel);
  /// Nullptr when the type is not known.
  const cdr::Structure* structure(const mcap::Channel& channel);
  /// A clause for the user, of a channel whose types() is a nullptr.
  [[nodiscard]] std::string why_unknown(const mcap::Channel& channel);
  [[nodiscard]] std::string type_name(const mcap::Channel& channel) const;
  [[nodiscard]] bool keyed(const mcap::Channel& channel);
  /// Tells instances of a keyed topic from each other; empty for others, and for bytes that are no such sample.
  std::string key(const mcap::Channel& channel, mcap::ByteView cdr);

 private:
  struct Described {
    cdr::Types types;
    core::Status read;  // whether the whole text could be
  };
  const Described& described(const mcap::Schema& schema);

  const mcap::Reader& reader_;
  std::map<uint16_t, Described> by_schema_;
};

/// A topic whose last value also reaches those who come later: calibrations and other standing values.
bool latched(const mcap::Channel& channel);

/// Value of a 64-bit member that stands among the first ones, before anything of another size ("stamp_ns",
/// "grabbed_ns"). Nothing when the structure has no such member there.
std::optional<int64_t> leading_int64(const cdr::Structure& structure, const std::string& member, mcap::ByteView cdr);

}  // namespace railfix::tool
