// Bit strings as SUBSET-026 8.4 packs them: most significant bit first, no gaps.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

namespace railfix::etcs {

class BitWriter {
 public:
  /// REQUIRES: count <= 32 and value < 2^count.
  void write(uint32_t value, unsigned count) {
    for (unsigned i = count; i-- > 0;) write_bit((value >> i & 1U) != 0);
  }
  void write_bit(bool bit) {
    if (size_ % 8 == 0) bytes_.push_back(0);
    if (bit) bytes_.back() = static_cast<uint8_t>(bytes_.back() | 0x80U >> size_ % 8);
    ++size_;
  }
  [[nodiscard]] size_t size() const { return size_; }
  /// Padded with zeros to a whole byte.
  [[nodiscard]] const std::vector<uint8_t>& bytes() const { return bytes_; }

 private:
  std::vector<uint8_t> bytes_;
  size_t size_ = 0;
};

class BitReader {
 public:
  explicit BitReader(std::span<const uint8_t> bytes) : bytes_(bytes) {}
  /// REQUIRES: count <= 32 and count <= left().
  uint32_t read(unsigned count) {
    uint32_t value = 0;
    for (unsigned i = 0; i < count; ++i) value = value << 1U | static_cast<uint32_t>(read_bit());
    return value;
  }
  bool read_bit() {
    const bool bit = (bytes_[position_ / 8] >> (7 - position_ % 8) & 1U) != 0;
    ++position_;
    return bit;
  }
  [[nodiscard]] size_t position() const { return position_; }
  [[nodiscard]] size_t left() const { return bytes_.size() * 8 - position_; }

 private:
  std::span<const uint8_t> bytes_;
  size_t position_ = 0;
};

}  // namespace railfix::etcs
