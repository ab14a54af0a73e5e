#include "mcap/records.hpp"

#include <libdeflate.h>

#include <algorithm>

namespace railfix::mcap {

namespace {

size_t begin(Encoder& encoder, Opcode opcode) {
  return encoder.begin_record(static_cast<uint8_t>(opcode));
}

void append_counts(Encoder& encoder, const std::map<uint16_t, uint64_t>& counts) {
  const size_t array = encoder.begin_array();
  for (const auto& [id, count] : counts) {
    encoder.u16(id);
    encoder.u64(count);
  }
  encoder.end_array(array);
}

std::map<uint16_t, uint64_t> parse_counts(Decoder& decoder) {
  Decoder inside(decoder.raw(decoder.u32()));
  std::map<uint16_t, uint64_t> counts;
  while (inside.left() >= 10) {
    const uint16_t id = inside.u16();
    counts[id] = inside.u64();
  }
  return counts;
}

}  // namespace

void Statistics::count(uint16_t channel_id, int64_t log_time_ns) {
  start_ns = messages == 0 ? log_time_ns : std::min(start_ns, log_time_ns);
  end_ns = messages == 0 ? log_time_ns : std::max(end_ns, log_time_ns);
  ++messages;
  ++channel_messages[channel_id];
}

void append(Bytes& out, const Schema& schema) {
  Encoder encoder(out);
  const size_t record = begin(encoder, Opcode::schema);
  encoder.u16(schema.id);
  encoder.text(schema.name);
  encoder.text(schema.encoding);
  encoder.text(schema.data);
  encoder.end_record(record);
}

void append(Bytes& out, const Channel& channel) {
  Encoder encoder(out);
  const size_t record = begin(encoder, Opcode::channel);
  encoder.u16(channel.id);
  encoder.u16(channel.schema_id);
  encoder.text(channel.topic);
  encoder.text(channel.message_encoding);
  encoder.map(channel.metadata);
  encoder.end_record(record);
}

void append(Bytes& out, const Message& message) {
  Encoder encoder(out);
  const size_t record = begin(encoder, Opcode::message);
  encoder.u16(message.channel_id);
  encoder.u32(message.sequence);
  encoder.time(message.log_time_ns);
  encoder.time(message.publish_time_ns);
  encoder.raw(message.data);
  encoder.end_record(record);
}

void append(Bytes& out, const Metadata& metadata) {
  Encoder encoder(out);
  const size_t record = begin(encoder, Opcode::metadata);
  encoder.text(metadata.name);
  encoder.map(metadata.entries);
  encoder.end_record(record);
}

void append(Bytes& out, const ChunkHead& head, ByteView stored_records) {
  Encoder encoder(out);
  const size_t record = begin(encoder, Opcode::chunk);
  encoder.time(head.start_ns);
  encoder.time(head.end_ns);
  encoder.u64(head.uncompressed_bytes);
  encoder.u32(head.crc);
  encoder.text(head.compression);
  encoder.u64(stored_records.size());
  encoder.raw(stored_records);
  encoder.end_record(record);
}

void append(Bytes& out, const ChunkIndex& index) {
  Encoder encoder(out);
  const size_t record = begin(encoder, Opcode::chunk_index);
  encoder.time(index.start_ns);
  encoder.time(index.end_ns);
  encoder.u64(index.offset);
  encoder.u64(index.length);
  append_counts(encoder, index.message_index_offsets);
  encoder.u64(index.message_index_length);
  encoder.text(index.compression);
  encoder.u64(index.compressed_bytes);
  encoder.u64(index.uncompressed_bytes);
  encoder.end_record(record);
}

void append(Bytes& out, const MetadataIndex& index) {
  Encoder encoder(out);
  const size_t record = begin(encoder, Opcode::metadata_index);
  encoder.u64(index.offset);
  encoder.u64(index.length);
  encoder.text(index.name);
  encoder.end_record(record);
}

void append(Bytes& out, const Statistics& statistics) {
  Encoder encoder(out);
  const size_t record = begin(encoder, Opcode::statistics);
  encoder.u64(statistics.messages);
  encoder.u16(statistics.schemas);
  encoder.u32(statistics.channels);
  encoder.u32(statistics.attachments);
  encoder.u32(statistics.metadata);
  encoder.u32(statistics.chunks);
  encoder.time(statistics.start_ns);
  encoder.time(statistics.end_ns);
  append_counts(encoder, statistics.channel_messages);
  encoder.end_record(record);
}

bool parse(ByteView content, Schema& schema) {
  Decoder decoder(content);
  schema.id = decoder.u16();
  schema.name = decoder.text();
  schema.encoding = decoder.text();
  schema.data = decoder.text();
  return decoder.ok() && schema.id != 0;
}

bool parse(ByteView content, Channel& channel) {
  Decoder decoder(content);
  channel.id = decoder.u16();
  channel.schema_id = decoder.u16();
  channel.topic = decoder.text();
  channel.message_encoding = decoder.text();
  channel.metadata = decoder.map();
  return decoder.ok();
}

bool parse(ByteView content, Message& message) {
  Decoder decoder(content);
  message.channel_id = decoder.u16();
  message.sequence = decoder.u32();
  message.log_time_ns = decoder.time();
  message.publish_time_ns = decoder.time();
  message.data = decoder.rest();
  return decoder.ok();
}

bool parse(ByteView content, Metadata& metadata) {
  Decoder decoder(content);
  metadata.name = decoder.text();
  metadata.entries = decoder.map();
  return decoder.ok();
}

namespace {

/// Stands behind it then, in front of the stored records and their length.
Decoder parse_head(ByteView content, ChunkHead& head) {
  Decoder decoder(content);
  head.start_ns = decoder.time();
  head.end_ns = decoder.time();
  head.uncompressed_bytes = decoder.u64();
  head.crc = decoder.u32();
  head.compression = decoder.text();
  return decoder;
}

}  // namespace

bool parse(ByteView content, ChunkHead& head, ByteView& stored_records) {
  Decoder decoder = parse_head(content, head);
  stored_records = decoder.raw(decoder.u64());
  return decoder.ok();
}

bool parse(ByteView content, ChunkHead& head, uint64_t& stored_bytes) {
  Decoder decoder = parse_head(content, head);
  stored_bytes = decoder.u64();
  return decoder.ok();
}

bool parse(ByteView content, ChunkIndex& index) {
  Decoder decoder(content);
  index.start_ns = decoder.time();
  index.end_ns = decoder.time();
  index.offset = decoder.u64();
  index.length = decoder.u64();
  index.message_index_offsets = parse_counts(decoder);
  index.message_index_length = decoder.u64();
  index.compression = decoder.text();
  index.compressed_bytes = decoder.u64();
  index.uncompressed_bytes = decoder.u64();
  return decoder.ok();
}

bool parse(ByteView content, MetadataIndex& index) {
  Decoder decoder(content);
  index.offset = decoder.u64();
  index.length = decoder.u64();
  index.name = decoder.text();
  return decoder.ok();
}

bool parse(ByteView content, Statistics& statistics) {
  Decoder decoder(content);
  statistics.messages = decoder.u64();
  statistics.schemas = decoder.u16();
  statistics.channels = decoder.u32();
  statistics.attachments = decoder.u32();
  statistics.metadata = decoder.u32();
  statistics.chunks = decoder.u32();
  statistics.start_ns = decoder.time();
  statistics.end_ns = decoder.time();
  statistics.channel_messages = parse_counts(decoder);
  return decoder.ok();
}

bool parse(ByteView content, Footer& footer) {
  Decoder decoder(content);
  footer.summary_start = decoder.u64();
  footer.summary_offset_start = decoder.u64();
  footer.summary_crc = decoder.u32();
  return decoder.ok();
}

uint32_t crc32(ByteView bytes, uint32_t crc) {
  return libdeflate_crc32(crc, bytes.data(), bytes.size());
}

}  // namespace railfix::mcap
