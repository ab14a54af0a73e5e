// Where the records of a proper MCAP file end, found without our reader.
#pragma once

#include <filesystem>
#include <fstream>
#include <iterator>

#include "mcap/compression.hpp"
#include "mcap/records.hpp"

namespace railfix::test {

struct RecordEnd {
  size_t offset = 0;  // first byte behind the record
  uint8_t opcode = 0;
  size_t messages = 0;  // in the whole chunks up to here
};

/// Of the records of the data section that are whole; nothing when the file does not begin like one.
inline std::vector<RecordEnd> record_ends(const mcap::Bytes& file) {
  using mcap::Decoder;
  std::vector<RecordEnd> ends;
  if (file.size() < mcap::kMagic.size()) return ends;
  size_t messages = 0;
  Decoder decoder(mcap::ByteView(file).subspan(mcap::kMagic.size()));
  while (decoder.left() > mcap::kMagic.size()) {
    const uint8_t opcode = decoder.u8();
    const mcap::ByteView content = decoder.raw(decoder.u64());
    if (!decoder.ok()) break;
    mcap::ChunkHead head;
    mcap::ByteView stored;
    if (opcode == static_cast<uint8_t>(mcap::Opcode::chunk) && mcap::parse(content, head, stored)) {
      const mcap::Bytes records = mcap::chunk_records(head, stored).value();
      for (Decoder inside(records); inside.left() > 0; ++messages) {
        (void)inside.u8();
        (void)inside.raw(inside.u64());
      }
    }
    ends.push_back({mcap::kMagic.size() + decoder.position(), opcode, messages});
    if (opcode == static_cast<uint8_t>(mcap::Opcode::data_end)) break;
  }
  return ends;
}

/// Messages in the whole chunks of the first `size` bytes.
inline size_t messages_before(const std::vector<RecordEnd>& ends, size_t size) {
  size_t messages = 0;
  for (const auto& end : ends) messages = end.offset <= size ? end.messages : messages;
  return messages;
}

inline mcap::Bytes bytes_of_file(const std::filesystem::path& file) {
  std::ifstream stream(file, std::ios::binary);
  return {std::istreambuf_iterator<char>(stream), std::istreambuf_iterator<char>()};
}

}  // namespace railfix::test
