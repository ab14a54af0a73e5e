// MCAP files as other writers make them: of the summary they have what each of them thinks worth it.
#pragma once

#include <cstdint>

#include "mcap/records.hpp"

namespace railfix::test {

inline constexpr uint32_t kOtherSamples = 20;

/// What stands in the summary.
struct OtherSummary {
  bool schemas = false;
  bool channels = false;
  bool statistics = false;
  bool counts = false;  // of each channel, in the statistics
  bool chunk_indexes = false;
  bool message_indexes = false;  // and what points at them, in the chunk indexes

  static constexpr unsigned kCombinations = 64;
  /// One of the combinations, by its number.
  explicit OtherSummary(unsigned bits)
      : schemas((bits & 1U) != 0),
        channels((bits & 2U) != 0),
        statistics((bits & 4U) != 0),
        counts((bits & 8U) != 0),
        chunk_indexes((bits & 16U) != 0),
        message_indexes((bits & 32U) != 0) {}
};

/// All samples, of one topic "other" and with their number as the time in seconds and as their value, in one chunk.
inline mcap::Bytes other_writers_file(const OtherSummary& has) {
  using mcap::append;
  const mcap::Schema schema{1, "other::T", "omgidl", "module other { struct T { long x; }; };"};
  const mcap::Channel channel{5, 1, "other", "cdr", {}};
  mcap::Statistics statistics{0, 1, 1, 0, 0, 1, 0, 0, {}};
  mcap::Bytes records;
  mcap::Bytes message_index;
  mcap::Encoder in_message_index(message_index);
  append(records, schema);
  append(records, channel);
  const size_t begun = in_message_index.begin_record(static_cast<uint8_t>(mcap::Opcode::message_index));
  in_message_index.u16(channel.id);
  const size_t entries = in_message_index.begin_array();
  for (uint8_t i = 0; i < kOtherSamples; ++i) {
    const mcap::Bytes cdr{0, 1, 0, 0, i, 0, 0, 0};
    const int64_t at_ns = i * int64_t{1'000'000'000};
    in_message_index.time(at_ns);
    in_message_index.u64(records.size());
    append(records, mcap::Message{channel.id, i, at_ns, at_ns, cdr});
    statistics.count(channel.id, at_ns);
  }
  in_message_index.end_array(entries);
  in_message_index.end_record(begun);
  mcap::Bytes file(mcap::kMagic.begin(), mcap::kMagic.end());
  mcap::Encoder encoder(file);
  const size_t header = encoder.begin_record(static_cast<uint8_t>(mcap::Opcode::header));
  encoder.text("");
  encoder.text("other");
  encoder.end_record(header);
  mcap::ChunkIndex index{statistics.start_ns, statistics.end_ns, file.size(), 0, {}, 0, "",
                         records.size(),      records.size()};
  append(file, mcap::ChunkHead{index.start_ns, index.end_ns, records.size(), 0, ""}, records);
  index.length = file.size() - index.offset;
  if (has.message_indexes) {
    index.message_index_offsets[channel.id] = file.size();
    index.message_index_length = message_index.size();
    encoder.raw(message_index);
  }
  const size_t data_end = encoder.begin_record(static_cast<uint8_t>(mcap::Opcode::data_end));
  encoder.u32(0);
  encoder.end_record(data_end);

  const size_t summary = file.size();
  if (!has.counts) statistics.channel_messages.clear();
  if (has.schemas) append(file, schema);
  if (has.channels) append(file, channel);
  if (has.statistics) append(file, statistics);
  if (has.chunk_indexes) append(file, index);
  const bool any = file.size() > summary;
  const size_t footer = encoder.begin_record(static_cast<uint8_t>(mcap::Opcode::footer));
  encoder.u64(any ? summary : 0);
  encoder.u64(0);
  encoder.u32(0);
  encoder.end_record(footer);
  encoder.raw(mcap::kMagic);
  return file;
}

}  // namespace railfix::test
