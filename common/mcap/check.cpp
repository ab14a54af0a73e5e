#include "mcap/check.hpp"

#include <algorithm>

#include "mcap/compression.hpp"

namespace railfix::mcap {

namespace {

struct CheckedChunk {
  uint64_t length = 0;
  std::map<uint64_t, std::pair<uint16_t, int64_t>> messages;  // by position: channel and log time
  std::map<uint16_t, uint64_t> not_indexed;                   // messages of each channel
};

/// One pass over the records of a file.
class Checker {
 public:
  explicit Checker(const FileBytes& bytes) : bytes_(bytes) {}

  Check run() {
    if (!bytes_.has_magic(0)) {
      problem("does not begin like an MCAP file");
      return std::move(check_);
    }
    crc_ = crc32(kMagic);
    offset_ = kMagic.size();
    while (!done_ && next_record()) {
    }
    if (!done_) problem("was not closed properly: it has no footer");
    compare_statistics();
    return std::move(check_);
  }

 private:
  void problem(const std::string& what) {
    if (check_.problems.size() < kMostProblems) check_.problems.push_back(what);
  }
  void problem_here(const std::string& what) { problem("byte " + std::to_string(offset_) + ": " + what); }

  bool next_record() {
    const auto head = bytes_.read(offset_, kRecordHeadBytes);
    if (!head) {
      if (offset_ < bytes_.size()) problem_here("ends in the middle of a record");
      return false;
    }
    Decoder decoder(*head);
    const uint8_t opcode = decoder.u8();
    const uint64_t length = decoder.u64();
    const auto content = bytes_.read(offset_ + kRecordHeadBytes, length);
    if (!content || opcode == 0) {
      problem_here("ends in the middle of a record");
      return false;
    }
    if (opcode == static_cast<uint8_t>(Opcode::data_end)) data_end(*content);
    if (in_data_) crc_ = crc32(*content, crc32(*head, crc_));
    record(opcode, *content, kRecordHeadBytes + length);
    offset_ += kRecordHeadBytes + length;
    return true;
  }

  void record(uint8_t opcode, ByteView content, uint64_t length) {
    switch (static_cast<Opcode>(opcode)) {
      case Opcode::schema:
      case Opcode::channel:
      case Opcode::message:
        return inner(opcode, content, nullptr, 0);
      case Opcode::chunk:
        return chunk(content, length);
      case Opcode::message_index:
        return message_index(content);
      case Opcode::chunk_index:
        return chunk_index(content);
      case Opcode::statistics:
        if (Statistics statistics; parse(content, statistics)) statistics_ = statistics;
        return;
      case Opcode::footer:
        return footer(content);
      default:
        return;
    }
  }

  /// A record that may stand in a chunk or outside.
  void inner(uint8_t opcode, ByteView content, CheckedChunk* chunk, uint64_t position) {
    if (Schema schema; opcode == static_cast<uint8_t>(Opcode::schema)) {
      if (!parse(content, schema)) return problem_here("damaged schema");
      if (schemas_.emplace(schema.id, schema).first->second != schema) {
        problem_here("schema " + std::to_string(schema.id) + " is defined differently before");
      }
    } else if (Channel channel; opcode == static_cast<uint8_t>(Opcode::channel)) {
      if (!parse(content, channel)) return problem_here("damaged channel");
      if (channel.schema_id != 0 && !schemas_.contains(channel.schema_id)) {
        problem_here("channel " + channel.topic + " stands before its schema");
      }
      if (channels_.emplace(channel.id, channel).first->second != channel) {
        problem_here("channel " + std::to_string(channel.id) + " is defined differently before");
      }
    } else if (Message message; opcode == static_cast<uint8_t>(Opcode::message)) {
      if (!parse(content, message)) return problem_here("damaged message");
      count(message);
      if (chunk == nullptr) return;
      chunk->messages[position] = {message.channel_id, message.log_time_ns};
      ++chunk->not_indexed[message.channel_id];
    }
  }

  void count(const Message& message) {
    if (!channels_.contains(message.channel_id)) {
      problem_here("a message of channel " + std::to_string(message.channel_id) + " stands before its channel");
    }
    auto& channel = check_.channels[message.channel_id];
    if (channel.messages == 0) {
      channel.first_ns = channel.last_ns = message.log_time_ns;
    } else {
      channel.longest_gap_ns = std::max(channel.longest_gap_ns, message.log_time_ns - channel.last_ns);
    }
    ++channel.messages;
    channel.bytes += message.data.size();
    channel.first_ns = std::min(channel.first_ns, message.log_time_ns);
    channel.last_ns = std::max(channel.last_ns, message.log_time_ns);
  }

  void chunk(ByteView content, uint64_t length) {
    ++check_.chunks;
    ChunkHead head;
    ByteView stored;
    if (!parse(content, head, stored)) return problem_here("damaged chunk");
    check_.chunks_with_crc += head.crc != 0 ? 1 : 0;
    const auto records = chunk_records(head, stored);
    if (!records.ok()) return problem_here("chunk: " + records.error().message);
    CheckedChunk& checked = chunks_[offset_];
    checked.length = length;
    last_chunk_ = &checked;
    Decoder decoder(records.value());
    while (decoder.left() > 0) {
      const uint64_t position = decoder.position();
      const uint8_t opcode = decoder.u8();
      const ByteView one = decoder.raw(decoder.u64());
      if (!decoder.ok()) return problem_here("the chunk ends in a broken record");
      inner(opcode, one, &checked, position);
    }
    for (const auto& [at, message] : checked.messages) {
      if (message.second >= head.start_ns && message.second <= head.end_ns) continue;
      problem_here("a message of the chunk lies outside the chunk's times");
      break;
    }
  }

  void message_index(ByteView content) {
    Decoder decoder(content);
    const uint16_t channel = decoder.u16();
    Decoder entries(decoder.raw(decoder.u32()));
    if (last_chunk_ == nullptr) return problem_here("a message index without a chunk before it");
    while (entries.left() > 0 && entries.ok()) {
      const int64_t log_time_ns = entries.time();
      const auto message = last_chunk_->messages.find(entries.u64());
      if (message == last_chunk_->messages.end() || message->second != std::pair(channel, log_time_ns)) {
        return problem_here("the index of channel " + std::to_string(channel) + " points at no such message");
      }
      --last_chunk_->not_indexed[channel];
    }
    if (!decoder.ok() || !entries.ok()) problem_here("damaged message index");
  }

  void chunk_index(ByteView content) {
    ChunkIndex index;
    if (!parse(content, index)) return problem_here("damaged chunk index");
    const auto chunk = chunks_.find(index.offset);
    if (chunk == chunks_.end() || chunk->second.length != index.length) {
      return problem_here("the index points at byte " + std::to_string(index.offset) + ", where no such chunk is");
    }
    ++indexed_chunks_;
    if (index.message_index_offsets.empty()) return;  // its writer makes no index of messages
    for (const auto& [channel, missing] : chunk->second.not_indexed) {
      if (missing == 0) continue;
      problem("byte " + std::to_string(index.offset) + ": " + std::to_string(missing) + " messages of channel " +
              std::to_string(channel) + " are not in the chunk's index");
    }
  }

  void data_end(ByteView content) {
    in_data_ = false;
    summary_begin_ = offset_ + kRecordHeadBytes + content.size();
    Decoder decoder(content);
    const uint32_t crc = decoder.u32();
    check_.data_crc = crc != 0;
    if (crc != 0 && crc != crc_) problem_here("the checksum of the data is wrong");
  }

  void footer(ByteView content) {
    done_ = true;
    Footer footer;
    if (!parse(content, footer)) return problem_here("damaged footer");
    check_.summary_crc = footer.summary_crc != 0;
    const uint64_t begin = footer.summary_start != 0 ? footer.summary_start : offset_;
    const uint64_t end = offset_ + kRecordHeadBytes + kFooterBytes - sizeof(footer.summary_crc);
    const auto summary = begin <= end ? bytes_.read(begin, end - begin) : std::nullopt;
    if (!summary || (footer.summary_start != 0 && footer.summary_start != summary_begin_)) {
      problem_here("the footer does not say where the index begins");
    } else if (footer.summary_crc != 0 && crc32(*summary) != footer.summary_crc) {
      problem_here("the checksum of the index is wrong");
    }
    if (!bytes_.has_magic(offset_ + kRecordHeadBytes + kFooterBytes)) problem("does not end like an MCAP file");
  }

  void compare_statistics() {
    if (!statistics_) return;
    uint64_t messages = 0;
    for (const auto& [id, channel] : check_.channels) {
      messages += channel.messages;
      const auto told = statistics_->channel_messages.find(id);
      if (told != statistics_->channel_messages.end() && told->second == channel.messages) continue;
      if (statistics_->channel_messages.empty()) continue;  // other writers do not count them
      problem("channel " + std::to_string(id) + " has " + std::to_string(channel.messages) +
              " messages, its statistics say otherwise");
    }
    if (messages != statistics_->messages) problem("the statistics count other messages than there are");
    const bool indexed = indexed_chunks_ != 0;  // the format does not ask for it
    if (check_.chunks != statistics_->chunks || (indexed && indexed_chunks_ != check_.chunks)) {
      problem("the file has " + std::to_string(check_.chunks) + " chunks, its index " +
              std::to_string(indexed_chunks_));
    }
  }

  const FileBytes& bytes_;
  Check check_;
  uint64_t offset_ = 0;
  uint32_t crc_ = 0;
  bool in_data_ = true;
  bool done_ = false;
  uint64_t summary_begin_ = 0;
  uint64_t indexed_chunks_ = 0;
  std::map<uint16_t, Schema> schemas_;
  std::map<uint16_t, Channel> channels_;
  std::map<uint64_t, CheckedChunk> chunks_;
  CheckedChunk* last_chunk_ = nullptr;
  std::optional<Statistics> statistics_;
};

}  // namespace

core::Result<Check> check(const std::filesystem::path& file) {
  const auto bytes = FileBytes::open(file);
  if (!bytes.ok()) return bytes.error();
  return Checker(*bytes.value()).run();
}

}  // namespace railfix::mcap
