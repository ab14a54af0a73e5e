// Reads a recording that has no index to read it by: every whole record, one behind the other.
#include <algorithm>
#include <limits>

#include "mcap/compression.hpp"
#include "mcap/reader.hpp"

namespace railfix::mcap {

namespace {

constexpr uint64_t kBlockBytes = 1U << 20U;
// The record's, the fields of fixed size, and the name of a compression that can be read.
constexpr uint64_t kMostChunkHeadBytes = kRecordHeadBytes + 40 + 4;

/// Whether the head of a chunk stands there that can be right. Hostile bytes can look so in many places, each of which
/// claims the rest of the file: whole chunks are read only where this is true.
bool may_be_chunk(ByteView bytes, uint64_t left_in_file) {
  if (bytes.front() != static_cast<uint8_t>(Opcode::chunk)) return false;
  Decoder decoder(bytes.first(std::min<uint64_t>(bytes.size(), kMostChunkHeadBytes)));
  (void)decoder.u8();
  const uint64_t length = decoder.u64();
  if (!decoder.ok() || length > left_in_file - kRecordHeadBytes) return false;
  ChunkHead head;
  uint64_t stored_bytes = 0;
  return parse(decoder.rest(), head, stored_bytes) && stored_bytes < length && head.start_ns <= head.end_ns &&
         head.crc != 0 && check_head(head, stored_bytes).ok();
}

}  // namespace

bool Reader::scan(const GoesOn& goes_on) {
  uint64_t offset = kMagic.size();
  const uint64_t size = bytes_->size();
  while (offset < size) {
    if (goes_on && !goes_on()) return false;
    if (offset + kMagic.size() == size && bytes_->has_magic(offset)) return true;
    const auto record = record_at(offset);
    if (!record || record->opcode == 0) {
      if (!skip_damage(offset, goes_on)) return false;
      continue;
    }
    const uint64_t bytes = kRecordHeadBytes + record->content.size();
    if (!scan_record(record->opcode, offset, record->content)) {
      unread_bytes_ += bytes;
      problem("the record at byte " + std::to_string(offset) + " is damaged and left out");
    }
    if (record->opcode == static_cast<uint8_t>(Opcode::data_end)) return true;
    offset += bytes;
  }
  return true;
}

bool Reader::skip_damage(uint64_t& offset, const GoesOn& goes_on) {
  bool stopped = false;
  const auto next = chunk_behind(offset, [&] {
    stopped = goes_on && !goes_on();
    return !stopped;
  });
  if (stopped) return false;
  const uint64_t size = bytes_->size();
  const std::string where = "byte " + std::to_string(offset) + " of " + std::to_string(size);
  problem(next ? "no record begins at " + where + ", where one should; goes on with the chunk at byte " +
                     std::to_string(*next)
               : "ends in the middle of a record at " + where);
  unread_bytes_ += next.value_or(size) - offset;
  offset = next.value_or(size);
  return true;
}

std::optional<Reader::Record> Reader::record_at(uint64_t offset) const {
  const auto head = bytes_->read(offset, kRecordHeadBytes);
  if (!head) return std::nullopt;
  Decoder decoder(*head);
  const uint8_t opcode = decoder.u8();
  auto content = bytes_->read(offset + kRecordHeadBytes, decoder.u64());
  return content ? std::optional(Record{opcode, std::move(*content)}) : std::nullopt;
}

// Where a length is damaged, or a block of the disk, the whole chunks behind it are still there.
std::optional<uint64_t> Reader::chunk_behind(uint64_t offset, const GoesOn& goes_on) const {
  const uint64_t size = bytes_->size();
  for (uint64_t begin = offset + 1; begin < size && goes_on(); begin += kBlockBytes) {
    const auto block = bytes_->read(begin, std::min(kBlockBytes + kMostChunkHeadBytes, size - begin));
    if (!block) return std::nullopt;
    for (uint64_t i = 0; i < std::min<uint64_t>(block->size(), kBlockBytes); ++i) {
      const uint64_t at = begin + i;
      if (!may_be_chunk(ByteView(*block).subspan(i), size - at)) continue;
      if (!goes_on()) return std::nullopt;
      if (is_whole_chunk(at)) return at;
    }
  }
  return std::nullopt;
}

bool Reader::is_whole_chunk(uint64_t offset) const {
  const auto record = record_at(offset);
  ChunkHead head;
  ByteView stored;
  return record && parse(record->content, head, stored) && chunk_records(head, stored).ok();
}

bool Reader::scan_record(uint8_t opcode, uint64_t offset, ByteView content) {
  const uint64_t length = kRecordHeadBytes + content.size();
  switch (static_cast<Opcode>(opcode)) {
    case Opcode::metadata: {
      Metadata metadata;
      if (!parse(content, metadata)) return false;
      metadata_.push_back(std::move(metadata));
      ++statistics_.metadata;
      return true;
    }
    case Opcode::attachment:
      ++statistics_.attachments;
      return true;
    case Opcode::message: {
      Message message;
      if (!parse(content, message)) return false;
      statistics_.count(message.channel_id, message.log_time_ns);
      places_.push_back({message.log_time_ns, message.log_time_ns, offset, length, true, {message.channel_id}});
      return true;
    }
    case Opcode::chunk: {
      ChunkPlace place{0, 0, offset, length, false, {}};
      const auto records = load(place, std::numeric_limits<uint64_t>::max());
      if (!records) return true;  // load() has said why
      Statistics inside;
      Decoder decoder(*records);
      while (decoder.left() > 0) {
        const uint8_t inner = decoder.u8();
        const ByteView inner_content = decoder.raw(decoder.u64());
        Message message;
        if (!decoder.ok()) break;
        if (inner != static_cast<uint8_t>(Opcode::message)) {
          (void)learn(inner, inner_content);
        } else if (parse(inner_content, message)) {
          inside.count(message.channel_id, message.log_time_ns);
          statistics_.count(message.channel_id, message.log_time_ns);
        }
      }
      place.start_ns = inside.start_ns;
      place.end_ns = inside.end_ns;
      for (const auto& [id, count] : inside.channel_messages) place.channels.push_back(id);
      places_.push_back(place);
      ++statistics_.chunks;
      return true;
    }
    default: {
      const bool known = learn(opcode, content);
      statistics_.schemas = static_cast<uint16_t>(schemas_.size());
      statistics_.channels = static_cast<uint32_t>(channels_.size());
      return known;
    }
  }
}

}  // namespace railfix::mcap
