#include "mcap/reader.hpp"

#include <algorithm>
#include <ranges>

#include "mcap/compression.hpp"
#include "mcap/losses.hpp"
#include "mcap/writer.hpp"

namespace railfix::mcap {

namespace {

constexpr uint64_t kTailBytes = kRecordHeadBytes + kFooterBytes + kMagic.size();
constexpr uint64_t kMostMetadataBytes = uint64_t{1} << 24U;
// Gigabytes forced to the disk at once would hold up who else writes there.
constexpr double kRecoverySyncS = 1;

core::Error stopped(const std::filesystem::path& file) {
  return core::Error{"reading " + file.string() + " was stopped"};
}

}  // namespace

core::Result<std::unique_ptr<Reader>> Reader::open(const std::filesystem::path& file, const GoesOn& goes_on) {
  auto bytes = FileBytes::open(file);
  if (!bytes.ok()) return bytes.error();
  std::unique_ptr<Reader> reader(new Reader(file, bytes.value()));
  if (!reader->bytes_->has_magic(0)) {
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

bool Reader::read_summary_record(uint8_t opcode, ByteView content, Summary& summary) {
  switch (static_cast<Opcode>(opcode)) {
    case Opcode::statistics:
      summary.counted = true;
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
      summary.metadata.push_back(index);
      return true;
    }
    default:
      return learn(opcode, content);
  }
}

bool Reader::read_summary() {
  const uint64_t size = bytes_->size();
  if (size < kMagic.size() + kTailBytes || !bytes_->has_magic(size - kMagic.size())) {
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
  closed_ = footer.summary_start == 0;
  if (closed_) return false;  // legal: a file without an index
  const auto bytes = bytes_->read(footer.summary_start, size - kMagic.size() - footer.summary_start);
  if (!bytes) return false;
  const ByteView checked = ByteView(*bytes).first(bytes->size() - 4);
  if (footer.summary_crc != 0 && crc32(checked) != footer.summary_crc) {
    problem("the checksum of its index is wrong, so it is read by a scan");
    return false;
  }
  Decoder decoder(checked.first(footer_offset - footer.summary_start));
  Summary summary;
  while (decoder.left() > 0) {
    const uint8_t opcode = decoder.u8();
    const ByteView content = decoder.raw(decoder.u64());
    if (!decoder.ok() || !read_summary_record(opcode, content, summary)) {
      problem("its index is damaged, so it is read by a scan");
      return false;
    }
  }
  closed_ = true;
  if (!suffices(summary)) return false;
  std::ranges::sort(places_, {}, &ChunkPlace::offset);
  read_metadata(summary.metadata);
  return true;
}

// The format lets a writer leave out almost everything, and without an index messages may stand outside chunks.
bool Reader::suffices(const Summary& summary) const {
  const auto known = [this](uint16_t channel) { return channels_.contains(channel); };
  const auto described = [this](const auto& channel) {
    return channel.second.schema_id == 0 || schemas_.contains(channel.second.schema_id);
  };
  const bool whole = summary.counted && places_.size() == statistics_.chunks &&
                     channels_.size() == statistics_.channels && summary.metadata.size() == statistics_.metadata;
  return whole && (!places_.empty() || statistics_.messages == 0) && std::ranges::all_of(channels_, described) &&
         std::ranges::all_of(statistics_.channel_messages | std::views::keys, known) &&
         std::ranges::all_of(places_, [&](const auto& place) { return std::ranges::all_of(place.channels, known); });
}

void Reader::read_metadata(const std::vector<MetadataIndex>& indexes) {
  for (const MetadataIndex& index : indexes) {
    const auto record = bytes_->read(index.offset, index.length);
    Metadata metadata;
    if (record && record->size() > kRecordHeadBytes && parse(ByteView(*record).subspan(kRecordHeadBytes), metadata)) {
      metadata_.push_back(std::move(metadata));
    } else {
      problem("metadata '" + index.name + "' is damaged");
    }
  }
}

std::optional<Bytes> Reader::load(const ChunkPlace& place, uint64_t most_bytes) {
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
  if (head.uncompressed_bytes > most_bytes) return lost("needs too much memory beside others of the same time");
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
  if (!opened.ok() || !opened.value()->has_magic(0)) return std::nullopt;
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
