#include "mcap/bytes.hpp"

namespace railfix::mcap {

void Encoder::map(const std::map<std::string, std::string>& entries) {
  const size_t begin = begin_array();
  for (const auto& [key, value] : entries) {
    text(key);
    text(value);
  }
  end_array(begin);
}

size_t Encoder::begin_record(uint8_t opcode) {
  const size_t begin = out_.size();
  u8(opcode);
  u64(0);
  return begin;
}

void Encoder::end_record(size_t begin) {
  const uint64_t length = out_.size() - begin - 9;
  for (size_t i = 0; i < 8; ++i) out_[begin + 1 + i] = static_cast<uint8_t>(length >> (8 * i));
}

size_t Encoder::begin_array() {
  u32(0);
  return out_.size() - 4;
}

void Encoder::end_array(size_t begin) {
  const uint64_t length = out_.size() - begin - 4;
  for (size_t i = 0; i < 4; ++i) out_[begin + i] = static_cast<uint8_t>(length >> (8 * i));
}

ByteView Decoder::raw(uint64_t count) {
  if (!ok_ || count > left()) {
    ok_ = false;
    return {};
  }
  const ByteView bytes = bytes_.subspan(position_, count);
  position_ += count;
  return bytes;
}

std::string Decoder::text() {
  const ByteView bytes = raw(u32());
  return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
}

std::map<std::string, std::string> Decoder::map() {
  Decoder inside(raw(u32()));
  std::map<std::string, std::string> entries;
  while (inside.ok() && inside.left() > 0) {
    std::string key = inside.text();
    entries[std::move(key)] = inside.text();
  }
  ok_ = ok_ && inside.ok();
  return entries;
}

}  // namespace railfix::mcap
