#include "mcap/reader.hpp"

#include <algorithm>

#include "mcap/compression.hpp"
#include "mcap/losses.hpp"
#include "mcap/writer.hpp"

namespace railfix::mcap {

namespace {

constexpr uint64_t kTailBytes = kRecordHeadBytes + kFooterBytes + kMagic.size();
constexpr uint64_t kMostMetadataBytes = uint64_t{1} << 24U;
// Gigabytes forced to the disk at once would hold up who else writes there.
constexpr double kRecoverySyncS = 1;

bool has_magic(const std::optional<Bytes>& bytes) {
  return bytes && std::ranges::equal(*bytes, kMagic);
}

core::Error stopped(const std::filesystem::path& file) {
  return core::Error{"reading " + file.string() + " was stopped"};
}

}  // namespace

core::Result<std::unique_ptr<Reader>> Reader::open(const std::filesystem::path& file, const GoesOn& goes_on) {
  auto bytes = FileBytes::open(file);
  if (!bytes.ok()) return bytes.error();
  std::unique_ptr<Reader> reader(new Reader(file, bytes.value()));
  if (!has_magic(reader->bytes_->read(0, kMagic.size()))) {
    return core::Error{file.string() + (reader->bytes_->size() == 0 ? " is empty" : " is not an MCAP recording") +
                       "; give a file that the recorder wrote"};
  }
  reader->indexed_ = reader->read_summary();
  if (!reader->indexed_) {
    reader->schemas_.clear();
    reader->channels_.clear();
    reader->metadata_.clear();
    reader->places_.clear();
    reader->statistics_ = {};
    if (!reader->scan(goes_on)) return stopped(file);
  }
  return reader;
}

void Reader::problem(const std::string& what) {
  const std::string sentence = file_.string() + ": " + what;
  const bool said = std::ranges::find(problems_, sentence) != problems_.end();
  if (!said && problems_.size() < kMostProblems) problems_.push_back(sentence);
}

bool Reader::learn(uint8_t opcode, ByteView content) {
  if (opcode == static_cast<uint8_t>(Opcode::schema)) {
    Schema schema;
    if (!parse(content, schema)) return false;
    const auto [known, added] = schemas_.emplace(schema.id, schema);
    if (!added && known->second != schema) {
      problem("schema " + std::to_string(schema.id) + " is defined twice and differently; the first one is used");
    }
  } else if (opcode == static_cast<uint8_t>(Opcode::channel)) {
    Channel channel;
    if (!parse(content, channel)) return false;
    const auto [known, added] = channels_.emplace(channel.id, channel);
    if (!added && known->second != channel) {
      problem("channel " + std::to_string(channel.id) + " is defined twice and differently; the first one is used");
    }
  }
  return true;
}

bool Reader::read_summary_record(uint8_t opcode, ByteView content, std::vector<MetadataIndex>& metadata) {
  switch (static_cast<Opcode>(opcode)) {
    case Opcode::statistics:
      return parse(content, statistics_);
    case Opcode::chunk_index: {
      ChunkIndex index;
      if (!parse(content, index)) return false;
      places_.push_back({index.start_ns, index.end_ns, index.offset, index.length, false, {}});
      for (const auto& [channel, offset] : index.message_index_offsets) places_.back().channels.push_back(channel);
      return true;
    }
    case Opcode::metadata_index: {
      MetadataIndex index;
      if (!parse(content, index)) return false;
      metadata.push_back(index);
      return true;
    }
    default:
      return learn(opcode, content);
  }
}

bool Reader::read_summary() {
  const uint64_t size = bytes_->size();
  if (size < kMagic.size() + kTailBytes || !has_magic(bytes_->read(size - kMagic.size(), kMagic.size()))) {
    problem("was not closed properly, so it is read by a scan; what the recorder had not yet written is missing");
    return false;
  }
  const uint64_t footer_offset = size - kTailBytes;
  const auto tail = bytes_->read(footer_offset, kTailBytes);
  Footer footer;
  if (!tail || tail->front() != static_cast<uint8_t>(Opcode::footer) ||
      !parse(ByteView(*tail).subspan(kRecordHeadBytes, kFooterBytes), footer) || footer.summary_start > footer_offset) {
    problem("its footer is damaged, so it is read by a scan");
    return false;
  }
  if (footer.summary_start == 0) return false;  // legal: a file without an index
  const auto summary = bytes_->read(footer.summary_start, size - kMagic.size() - footer.summary_start);
  if (!summary) return false;
  const ByteView checked = ByteView(*summary).first(summary->size() - 4);
  if (footer.summary_crc != 0 && crc32(checked) != footer.summary_crc) {
    problem("the checksum of its index is wrong, so it is read by a scan");
    return false;
  }
  Decoder decoder(checked.first(footer_offset - footer.summary_start));
  std::vector<MetadataIndex> metadata_indexes;
  while (decoder.left() > 0) {
    const uint8_t opcode = decoder.u8();
    const ByteView content = decoder.raw(decoder.u64());
    if (!decoder.ok() || !read_summary_record(opcode, content, metadata_indexes)) {
      problem("its index is damaged, so it is read by a scan");
      return false;
    }
  }
  if (places_.empty() && statistics_.messages > 0) return false;  // its messages stand outside chunks
  std::ranges::sort(places_, {}, &ChunkPlace::offset);
  for (const MetadataIndex& index : metadata_indexes) {
    const auto record = bytes_->read(index.offset, index.length);
    Metadata metadata;
    if (record && record->size() > kRecordHeadBytes && parse(ByteView(*record).subspan(kRecordHeadBytes), metadata)) {
      metadata_.push_back(std::move(metadata));
    } else {
      problem("metadata '" + index.name + "' is damaged");
    }
  }
  return true;
}

bool Reader::scan(const GoesOn& goes_on) {
  uint64_t offset = kMagic.size();
  const uint64_t size = bytes_->size();
  while (offset < size) {
    if (goes_on && !goes_on()) return false;
    if (offset + kMagic.size() == size && has_magic(bytes_->read(offset, kMagic.size()))) return true;
    const auto record = record_at(offset);
    if (!record || record->opcode == 0) {
      const auto next = chunk_behind(offset);
      unread_bytes_ += next.value_or(size) - offset;
      const std::string where = "byte " + std::to_string(offset) + " of " + std::to_string(size);
      if (!next) {
        problem("ends in the middle of a record at " + where);
        return true;
      }
      problem("no record begins at " + where + ", where one should; goes on with the chunk at byte " +
              std::to_string(*next));
      offset = *next;
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

std::optional<Reader::Record> Reader::record_at(uint64_t offset) const {
  const auto head = bytes_->read(offset, kRecordHeadBytes);
  if (!head) return std::nullopt;
  Decoder decoder(*head);
  const uint8_t opcode = decoder.u8();
  auto content = bytes_->read(offset + kRecordHeadBytes, decoder.u64());
  return content ? std::optional(Record{opcode, std::move(*content)}) : std::nullopt;
}

// Where a length is damaged, or a block of the disk, the whole chunks behind it are still there.
std::optional<uint64_t> Reader::chunk_behind(uint64_t offset) const {
  constexpr uint64_t kBlockBytes = 1U << 20U;
  const auto is_chunk = [&](uint64_t at) {
    const auto record = record_at(at);
    ChunkHead chunk;
    ByteView stored;
    return record && parse(record->content, chunk, stored) && chunk.crc != 0 && chunk_records(chunk, stored).ok();
  };
  for (uint64_t at = offset + 1; at < bytes_->size(); at += kBlockBytes) {
    const auto block = bytes_->read(at, std::min(kBlockBytes, bytes_->size() - at));
    if (!block) return std::nullopt;
    for (size_t i = 0; i < block->size(); ++i) {
      if ((*block)[i] == static_cast<uint8_t>(Opcode::chunk) && is_chunk(at + i)) return at + i;
    }
  }
  return std::nullopt;
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
      const auto records = load(place);
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

std::optional<Bytes> Reader::load(const ChunkPlace& place) {
  const auto lost = [&](const std::string& why) {
    problem("the chunk at byte " + std::to_string(place.offset) + " " + why + "; its messages are missing");
    lost_chunks_[place.offset] = place.length;
    return std::nullopt;
  };
  auto record = bytes_->read(place.offset, place.length);
  if (!record || record->size() < kRecordHeadBytes) return lost("is not in the file");
  if (place.loose) return record;
  ChunkHead head;
  ByteView stored;
  if (record->front() != static_cast<uint8_t>(Opcode::chunk) ||
      !parse(ByteView(*record).subspan(kRecordHeadBytes), head, stored)) {
    return lost("is damaged");
  }
  auto records = chunk_records(head, stored);
  if (!records.ok()) return lost("cannot be used, " + records.error().message);
  return std::move(records).value();
}

Messages Reader::messages(Selection selection) {
  return {*this, std::move(selection)};
}

void Reader::for_each(const Selection& selection,
                      const std::function<bool(const Channel& channel, const Message& message)>& use) {
  Messages all = messages(selection);
  while (const auto message = all.next()) {
    if (!use(channels_.at(message->channel_id), *message)) return;
  }
}

std::optional<Metadata> metadata_in_front(const std::filesystem::path& file, const std::string& name) {
  const auto opened = FileBytes::open(file);
  if (!opened.ok() || !has_magic(opened.value()->read(0, kMagic.size()))) return std::nullopt;
  const FileBytes& bytes = *opened.value();
  uint64_t offset = kMagic.size();
  while (const auto head = bytes.read(offset, kRecordHeadBytes)) {
    Decoder decoder(*head);
    const auto opcode = static_cast<Opcode>(decoder.u8());
    const uint64_t length = decoder.u64();
    offset += kRecordHeadBytes;
    const bool in_front =
        opcode == Opcode::header || opcode == Opcode::schema || opcode == Opcode::channel || opcode == Opcode::metadata;
    if (!in_front || length > bytes.size() - offset) break;
    if (opcode == Opcode::metadata && length <= kMostMetadataBytes) {
      const auto content = bytes.read(offset, length);
      Metadata metadata;
      if (content && parse(*content, metadata) && metadata.name == name) return metadata;
    }
    offset += length;
  }
  return std::nullopt;
}

std::filesystem::path recovered_name(const std::filesystem::path& damaged) {
  std::filesystem::path name = damaged;
  for (const char* ending : {".active", ".mcap"}) {
    if (name.extension() == ending) name.replace_extension();
  }
  return name.string() + "-recovered.mcap";
}

namespace {

core::Status copy(Reader& in, Writer& to, const std::filesystem::path& damaged, const GoesOn& goes_on) {
  std::map<uint16_t, uint16_t> schema_ids{{0, 0}};
  std::map<uint16_t, uint16_t> channel_ids;
  for (const auto& [id, schema] : in.schemas()) {
    auto added = to.add_schema(schema.name, schema.encoding, schema.data);
    if (!added.ok()) return added.error();
    schema_ids[id] = added.value();
  }
  for (const auto& [id, channel] : in.channels()) {
    auto added =
        to.add_channel(schema_ids[channel.schema_id], channel.topic, channel.message_encoding, channel.metadata);
    if (!added.ok()) return added.error();
    channel_ids[id] = added.value();
  }
  core::Status status;
  for (const Metadata& metadata : in.metadata()) {
    status = to.write_metadata(metadata);
    if (!status.ok()) return status;
  }
  uint64_t messages = 0;
  in.for_each({}, [&](const Channel& channel, Message message) {
    message.channel_id = channel_ids.at(channel.id);
    status = goes_on && !goes_on() ? core::Status(stopped(damaged)) : to.write(message);
    messages += status.ok() ? 1 : 0;
    return status.ok();
  });
  return status.ok() ? to.write_metadata(repair_trace(losses_of(in, messages), damaged)) : status;
}

}  // namespace

core::Result<std::vector<std::string>> recover(const std::filesystem::path& damaged, const std::filesystem::path& out,
                                               const GoesOn& goes_on) {
  auto reader = Reader::open(damaged, goes_on);
  if (!reader.ok()) return reader.error();
  WriterOptions options;
  options.sync_period_s = kRecoverySyncS;
  options.overwrite = true;
  auto writer = Writer::create(out, options);
  if (!writer.ok()) return writer.error();
  auto status = copy(*reader.value(), *writer.value(), damaged, goes_on);
  if (status.ok()) status = writer.value()->close();
  if (!status.ok()) {
    // Half a copy is of no use and takes the room of the next one.
    writer.value()->discard();
    return status.error();
  }
  return reader.value()->problems();
}

}  // namespace railfix::mcap
