// The records of an MCAP file (mcap.dev/spec, version '0') and their bytes. Times are nanoseconds since the Unix epoch.
#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <string>

#include "core/result.hpp"
#include "mcap/bytes.hpp"

namespace railfix::mcap {

inline constexpr std::array<uint8_t, 8> kMagic{0x89, 'M', 'C', 'A', 'P', '0', '\r', '\n'};
inline constexpr size_t kRecordHeadBytes = 9;    // opcode and length
inline constexpr size_t kMessageHeadBytes = 22;  // of a Message's content, before its data
inline constexpr size_t kFooterBytes = 20;       // of the Footer's content

enum class Opcode : uint8_t {
  header = 0x01,
  footer = 0x02,
  schema = 0x03,
  channel = 0x04,
  message = 0x05,
  chunk = 0x06,
  message_index = 0x07,
  chunk_index = 0x08,
  attachment = 0x09,
  attachment_index = 0x0A,
  statistics = 0x0B,
  metadata = 0x0C,
  metadata_index = 0x0D,
  summary_offset = 0x0E,
  data_end = 0x0F,
};

struct Schema {
  uint16_t id = 0;       // never 0
  std::string name;      // "railfix::msg::TrackView"
  std::string encoding;  // "omgidl"
  std::string data;
  bool operator==(const Schema&) const = default;
};

struct Channel {
  uint16_t id = 0;
  uint16_t schema_id = 0;  // 0 = none
  std::string topic;
  std::string message_encoding;  // "cdr"
  std::map<std::string, std::string> metadata;
  bool operator==(const Channel&) const = default;
};

/// One message; `data` belongs to whoever made it (see Writer::write and Messages::next for how long it lives).
struct Message {
  uint16_t channel_id = 0;
  uint32_t sequence = 0;
  int64_t log_time_ns = 0;      // when it was received
  int64_t publish_time_ns = 0;  // when it was sent
  ByteView data;
};

struct Metadata {
  std::string name;
  std::map<std::string, std::string> entries;
  bool operator==(const Metadata&) const = default;
};

struct ChunkHead {
  int64_t start_ns = 0;
  int64_t end_ns = 0;
  uint64_t uncompressed_bytes = 0;
  uint32_t crc = 0;         // of the uncompressed records, 0 = not computed
  std::string compression;  // "", "zstd" or "lz4"
};

struct ChunkIndex {
  int64_t start_ns = 0;
  int64_t end_ns = 0;
  uint64_t offset = 0;  // of the Chunk record in the file
  uint64_t length = 0;  // of the Chunk record with its head
  std::map<uint16_t, uint64_t> message_index_offsets;
  uint64_t message_index_length = 0;
  std::string compression;
  uint64_t compressed_bytes = 0;
  uint64_t uncompressed_bytes = 0;
};

struct MetadataIndex {
  uint64_t offset = 0;
  uint64_t length = 0;
  std::string name;
};

struct Statistics {
  uint64_t messages = 0;
  uint16_t schemas = 0;
  uint32_t channels = 0;
  uint32_t attachments = 0;
  uint32_t metadata = 0;
  uint32_t chunks = 0;
  int64_t start_ns = 0;  // smallest log time, 0 without messages
  int64_t end_ns = 0;    // largest log time
  std::map<uint16_t, uint64_t> channel_messages;

  void count(uint16_t channel_id, int64_t log_time_ns);
  bool operator==(const Statistics&) const = default;
};

struct Footer {
  uint64_t summary_start = 0;
  uint64_t summary_offset_start = 0;
  uint32_t summary_crc = 0;
};

// Whole records with their head, appended to the buffer.
void append(Bytes& out, const Schema& schema);
void append(Bytes& out, const Channel& channel);
void append(Bytes& out, const Message& message);
void append(Bytes& out, const Metadata& metadata);
void append(Bytes& out, const ChunkHead& head, ByteView stored_records);
void append(Bytes& out, const ChunkIndex& index);
void append(Bytes& out, const MetadataIndex& index);
void append(Bytes& out, const Statistics& statistics);

// Contents without their head. False: the content is too short for its kind.
[[nodiscard]] bool parse(ByteView content, Schema& schema);
[[nodiscard]] bool parse(ByteView content, Channel& channel);
[[nodiscard]] bool parse(ByteView content, Message& message);  // data points into content
[[nodiscard]] bool parse(ByteView content, Metadata& metadata);
[[nodiscard]] bool parse(ByteView content, ChunkHead& head, ByteView& stored_records);
[[nodiscard]] bool parse(ByteView content, ChunkHead& head, uint64_t& stored_bytes);  // its beginning is enough
[[nodiscard]] bool parse(ByteView content, ChunkIndex& index);
[[nodiscard]] bool parse(ByteView content, MetadataIndex& index);
[[nodiscard]] bool parse(ByteView content, Statistics& statistics);
[[nodiscard]] bool parse(ByteView content, Footer& footer);

/// CRC-32/ISO-HDLC, continued from `crc` (0 at the beginning).
uint32_t crc32(ByteView bytes, uint32_t crc = 0);

}  // namespace railfix::mcap
