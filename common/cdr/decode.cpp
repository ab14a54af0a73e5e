#include "cdr/decode.hpp"

#include <algorithm>
#include <bit>
#include <cstring>

namespace railfix::cdr {

namespace {

using nlohmann::ordered_json;

constexpr size_t kEncapsulationBytes = 4;

struct DecodeError {
  std::string message;
};

std::string hex_text(std::span<const uint8_t> bytes, size_t shown) {
  static constexpr char kDigits[] = "0123456789abcdef";
  std::string text;
  for (const uint8_t byte : bytes.first(std::min(shown, bytes.size()))) {
    text += kDigits[byte >> 4U];
    text += kDigits[byte & 15U];
  }
  if (shown < bytes.size()) text += "... (" + std::to_string(bytes.size()) + " bytes)";
  return text;
}

/// JSON text must be UTF-8; whatever else a string holds is replaced.
std::string printable(std::span<const uint8_t> bytes) {
  const std::string text(bytes.begin(), bytes.end());
  const std::string dumped = ordered_json(text).dump(-1, ' ', false, ordered_json::error_handler_t::replace);
  return ordered_json::parse(dumped).get<std::string>();
}

class Decoder {
 public:
  Decoder(const Types& types, std::span<const uint8_t> body, bool big_endian, const DecodeOptions& options)
      : types_(types), body_(body), swap_(big_endian != (std::endian::native == std::endian::big)), options_(options) {}

  ordered_json structure(const Structure& type, size_t depth) {
    ordered_json object = ordered_json::object();
    for (const Member& member : type.members) {
      const size_t outer = where_.size();
      where_ += (outer == 0 ? "" : ".") + member.name;
      ordered_json value = array(member.type, 0, depth);
      where_.resize(outer);
      if (options_.hide_padding && member.name == "padding") continue;
      if (options_.name_constants && !member.constants.empty() && value.is_number_integer()) {
        value = named(type, member, value.get<int64_t>());
      }
      object[member.name] = std::move(value);
    }
    return object;
  }

 private:
  std::span<const uint8_t> bytes(uint64_t count) {
    if (count > body_.size() - position_) {
      throw DecodeError{where_ + " does not fit into the sample's " +
                        std::to_string(body_.size() + kEncapsulationBytes) + " bytes"};
    }
    const auto taken = body_.subspan(position_, count);
    position_ += count;
    return taken;
  }

  template <class T>
  T number() {
    position_ = std::min((position_ + sizeof(T) - 1) / sizeof(T) * sizeof(T), body_.size());
    const auto raw = bytes(sizeof(T));
    std::array<uint8_t, sizeof(T)> ordered{};
    std::copy(raw.begin(), raw.end(), ordered.begin());
    if (swap_) std::reverse(ordered.begin(), ordered.end());
    return std::bit_cast<T>(ordered);
  }

  ordered_json array(const Type& type, size_t dimension, size_t depth) {
    if (depth > kDeepest) throw DecodeError{"the types nest too deeply"};
    if (dimension == type.dimensions.size()) return value(type, depth);
    const uint64_t count = type.dimensions[dimension];
    const bool last = dimension + 1 == type.dimensions.size();
    if (last && type.kind == Kind::octet) return hex_text(bytes(count), options_.octets_shown);
    return elements(count, [&] { return array(type, dimension + 1, depth + 1); });
  }

  template <class Read>
  ordered_json elements(uint64_t count, const Read& read) {
    // Every element takes a byte at least: a length that is garbage is found before anything is made.
    if (count > body_.size() - position_) (void)bytes(count);
    ordered_json list = ordered_json::array();
    for (uint64_t i = 0; i < count; ++i) list.push_back(read());
    return list;
  }

  ordered_json sequence(const Type& type, size_t depth) {
    const uint64_t count = number<uint32_t>();
    if (type.bound != 0 && count > type.bound) {
      throw DecodeError{where_ + " says " + std::to_string(count) + " elements, but at most " +
                        std::to_string(type.bound) + " are allowed"};
    }
    if (type.element->kind == Kind::octet && type.element->dimensions.empty()) {
      return hex_text(bytes(count), options_.octets_shown);
    }
    return elements(count, [&] { return array(*type.element, 0, depth + 1); });
  }

  ordered_json text(const Type& type) {
    const uint64_t count = number<uint32_t>();  // with the closing zero
    if (type.bound != 0 && count > type.bound + 1) {
      throw DecodeError{where_ + " says " + std::to_string(count) + " characters, but at most " +
                        std::to_string(type.bound) + " are allowed"};
    }
    auto characters = bytes(count);
    if (!characters.empty() && characters.back() == 0) characters = characters.first(characters.size() - 1);
    return printable(characters);
  }

  ordered_json value(const Type& type, size_t depth) {
    switch (type.kind) {
      case Kind::boolean:
        return number<uint8_t>() != 0;
      case Kind::octet:
        return number<uint8_t>();
      case Kind::character:
        return printable(bytes(1));
      case Kind::int8:
        return number<int8_t>();
      case Kind::int16:
        return number<int16_t>();
      case Kind::uint16:
        return number<uint16_t>();
      case Kind::int32:
        return number<int32_t>();
      case Kind::uint32:
        return number<uint32_t>();
      case Kind::int64:
        return number<int64_t>();
      case Kind::uint64:
        return number<uint64_t>();
      case Kind::float32:
        return number<float>();
      case Kind::float64:
        return number<double>();
      case Kind::text:
        return text(type);
      case Kind::sequence:
        return sequence(type, depth);
      case Kind::structure:
        return structure(*type.structure, depth + 1);
    }
    throw DecodeError{where_ + " has a type that is not known"};
  }

  [[nodiscard]] ordered_json named(const Structure& type, const Member& member, int64_t value) const {
    const std::string prefix = type.name.substr(0, type.name.rfind("::") + 2) + member.constants;
    std::string names;
    int64_t left = value;
    for (auto i = types_.constants().lower_bound(prefix); i != types_.constants().end() && i->first.starts_with(prefix);
         ++i) {
      const std::string name = i->first.substr(prefix.size());
      if (!member.bits && i->second == value) return name;
      if (member.bits && i->second != 0 && (value & i->second) == i->second) {
        names += (names.empty() ? "" : "|") + name;
        left &= ~i->second;
      }
    }
    if (!member.bits || value == 0 || left != 0) return value;
    return names;
  }

  const Types& types_;
  std::span<const uint8_t> body_;
  bool swap_;
  const DecodeOptions& options_;
  size_t position_ = 0;
  std::string where_;
};

}  // namespace

core::Result<ordered_json> decode(const Types& types, const std::string& type_name, std::span<const uint8_t> cdr,
                                  const DecodeOptions& options) {
  const Structure* type = types.find(type_name);
  if (type == nullptr) return core::Error{"type " + type_name + " is not in the IDL"};
  if (cdr.size() < kEncapsulationBytes || cdr[0] != 0 || cdr[1] > 1) {
    return core::Error{type_name + ": the sample does not begin with a plain CDR header"};
  }
  try {
    return Decoder(types, cdr.subspan(kEncapsulationBytes), cdr[1] == 0, options).structure(*type, 0);
  } catch (const DecodeError& error) {
    return core::Error{type_name + ": " + error.message};
  }
}

}  // namespace railfix::cdr
