// Little-endian bytes of MCAP records: an encoder that grows a buffer and a decoder that never reads past its end.
#pragma once

#include <cstdint>
#include <cstring>
#include <map>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace railfix::mcap {

using Bytes = std::vector<uint8_t>;
using ByteView = std::span<const uint8_t>;

/// Appends to a buffer that the caller owns.
class Encoder {
 public:
  explicit Encoder(Bytes& out) : out_(out) {}

  void u8(uint8_t value) { out_.push_back(value); }
  void u16(uint16_t value) { little_endian(value); }
  void u32(uint32_t value) { little_endian(value); }
  void u64(uint64_t value) { little_endian(value); }
  void time(int64_t ns) { u64(static_cast<uint64_t>(ns)); }
  void raw(ByteView bytes) { out_.insert(out_.end(), bytes.begin(), bytes.end()); }
  void text(std::string_view text) {
    u32(static_cast<uint32_t>(text.size()));
    out_.insert(out_.end(), text.begin(), text.end());
  }
  void map(const std::map<std::string, std::string>& entries);

  /// Opcode and a length that end_record fills in; returns where the record begins.
  size_t begin_record(uint8_t opcode);
  void end_record(size_t begin);
  /// A byte count (u32) that end_array fills in; returns where it stands.
  size_t begin_array();
  void end_array(size_t begin);

 private:
  template <class T>
  void little_endian(T value) {
    for (size_t i = 0; i < sizeof(T); ++i) out_.push_back(static_cast<uint8_t>(value >> (8 * i)));
  }
  Bytes& out_;
};

/// Reads in order. After the first read past the end ok() is false and everything reads as zero or empty.
class Decoder {
 public:
  explicit Decoder(ByteView bytes) : bytes_(bytes) {}

  [[nodiscard]] bool ok() const { return ok_; }
  [[nodiscard]] size_t left() const { return bytes_.size() - position_; }
  [[nodiscard]] size_t position() const { return position_; }

  uint8_t u8() { return little_endian<uint8_t>(); }
  uint16_t u16() { return little_endian<uint16_t>(); }
  uint32_t u32() { return little_endian<uint32_t>(); }
  uint64_t u64() { return little_endian<uint64_t>(); }
  int64_t time() { return static_cast<int64_t>(u64()); }
  ByteView raw(uint64_t count);
  ByteView rest() { return raw(left()); }
  std::string text();
  std::map<std::string, std::string> map();

 private:
  template <class T>
  T little_endian() {
    const ByteView bytes = raw(sizeof(T));
    uint64_t value = 0;
    for (size_t i = 0; i < bytes.size(); ++i) value |= static_cast<uint64_t>(bytes[i]) << (8 * i);
    return static_cast<T>(value);
  }
  ByteView bytes_;
  size_t position_ = 0;
  bool ok_ = true;
};

}  // namespace railfix::mcap
