// One field of a message: its width and the values that the standard gives a meaning. Reader and writer refuse all
// others.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "core/result.hpp"
#include "etcs/bits.hpp"

namespace railfix::etcs {

/// Releases of SUBSET-026 whose layouts differ: 3.x and 4.0.0.
enum class Baseline : uint8_t { b3 = 3, b4 = 4 };

struct Field {
  const char* name;
  unsigned bits;
  uint32_t largest;                                // values above are spare ...
  std::optional<uint32_t> special = std::nullopt;  // ... but this one

  [[nodiscard]] constexpr uint32_t limit() const { return bits >= 32 ? UINT32_MAX : (1U << bits) - 1U; }
  [[nodiscard]] constexpr bool meaningful(uint32_t value) const { return value <= largest || value == special; }
};

/// A field all of whose values mean something.
constexpr Field full_field(const char* name, unsigned bits) {
  Field field{name, bits, 0};
  field.largest = field.limit();
  return field;
}

/// A value that the standard gives no meaning.
struct SpareValue {
  const char* field;
  uint32_t value;
};
/// "FIELD = VALUE is a spare value."
std::string sentence(const SpareValue& spare);

/// The first error stays; fields after it are skipped. Spare values are errors, unless they are to be listed.
class FieldReader {
 public:
  explicit FieldReader(BitReader& bits, std::vector<SpareValue>* spare = nullptr) : bits_(bits), spare_(spare) {}
  void field(const Field& field, uint32_t& value);
  void field_if(bool present, const char* when, const Field& field, std::optional<uint32_t>& value);
  [[nodiscard]] const core::Status& status() const { return status_; }

 private:
  BitReader& bits_;
  std::vector<SpareValue>* spare_;
  core::Status status_;
};

class FieldWriter {
 public:
  explicit FieldWriter(BitWriter& bits) : bits_(bits) {}
  void field(const Field& field, uint32_t value);
  void field_if(bool present, const char* when, const Field& field, const std::optional<uint32_t>& value);
  [[nodiscard]] const core::Status& status() const { return status_; }

 private:
  BitWriter& bits_;
  core::Status status_;
};

/// What is left of the last byte must be zero (8.4.4.5). REQUIRES: fewer than 8 bits are left.
core::Status read_padding(BitReader& bits);

}  // namespace railfix::etcs
