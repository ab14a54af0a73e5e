#include "mcap/writer.hpp"

#include <fcntl.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <utility>

#include "core/time.hpp"
#include "core/whole_file.hpp"

namespace railfix::mcap {

namespace {

constexpr size_t kMostIds = 65535;

core::Error io_error(const std::string& what, const std::filesystem::path& file) {
  return core::Error{file.string() + ": " + what + " (" + std::strerror(errno) + ")"};
}

/// The folder's entry of a new or renamed file reaches the disk only with the folder.
void sync_folder(const std::filesystem::path& file) {
  const std::filesystem::path folder = file.has_parent_path() ? file.parent_path() : ".";
  const int descriptor = ::open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
  if (descriptor < 0) return;
  ::fsync(descriptor);
  ::close(descriptor);
}

}  // namespace

core::Result<std::unique_ptr<Writer>> Writer::create(const std::filesystem::path& file, const WriterOptions& options) {
  std::unique_ptr<Writer> writer(new Writer(file, options));
  writer->active_ = file.string() + ".active";
  std::error_code failed;
  if (!options.overwrite && std::filesystem::exists(file, failed)) {
    return core::Error{file.string() + " exists already; choose another name or remove it"};
  }
  if (failed) return core::Error{file.string() + " cannot be created (" + failed.message() + "); choose another name"};
  const int flags = O_WRONLY | O_CREAT | O_CLOEXEC | (options.overwrite ? 0 : O_EXCL);
  writer->descriptor_ = ::open(writer->active_.c_str(), flags, 0644);
  if (writer->descriptor_ < 0) {
    if (errno == EEXIST) {
      return core::Error{
          writer->active_.string() +
          " exists: another process writes it or an earlier one was cut off; `railfix recording repair` makes a proper "
          "file of that, or remove it"};
    }
    return io_error("cannot be created; does the folder exist and may this user write there?", writer->active_);
  }
  // The lock goes with the process: recover() can tell a recording that is being written from one that was cut off.
  if (::flock(writer->descriptor_, LOCK_EX | LOCK_NB) != 0) {
    ::close(std::exchange(writer->descriptor_, -1));
    return core::Error{writer->active_.string() + " is being written by another recorder; choose another name"};
  }
  if (options.overwrite) (void)!::ftruncate(writer->descriptor_, 0);
  Bytes head(kMagic.begin(), kMagic.end());
  Encoder encoder(head);
  const size_t record = encoder.begin_record(static_cast<uint8_t>(Opcode::header));
  encoder.text("");
  encoder.text(options.library);
  encoder.end_record(record);
  const auto status = writer->put(head);
  if (!status.ok()) {
    writer->discard();
    return status.error();
  }
  writer->synced_ns_ = core::monotonic_ns();
  sync_folder(writer->active_);
  return writer;
}

Writer::~Writer() {
  try {
    (void)close();
  } catch (const std::exception&) {  // no memory for the tail; the chunks are there
  }
}

void Writer::discard() {
  wait_for_sync();
  if (descriptor_ >= 0) ::close(std::exchange(descriptor_, -1));
  std::error_code failed;
  std::filesystem::remove(active_, failed);
}

core::Status Writer::put(ByteView bytes) {
  if (descriptor_ < 0) return core::Error{file_.string() + " is closed already"};
  if (!core::write_all(descriptor_, std::as_bytes(bytes))) {
    const core::Error error = io_error("cannot be written; is the disk full?", active_);
    wait_for_sync();
    // Half a record would hide everything behind it.
    if (::ftruncate(descriptor_, static_cast<off_t>(offset_)) != 0 ||
        ::lseek(descriptor_, static_cast<off_t>(offset_), SEEK_SET) < 0) {
      ::close(descriptor_);
      descriptor_ = -1;
    }
    return error;
  }
  offset_ += bytes.size();
  if (options_.data_crc) data_crc_ = crc32(bytes, data_crc_);
  return {};
}

core::Result<uint16_t> Writer::add_schema(const std::string& name, const std::string& encoding,
                                          const std::string& data) {
  for (const Schema& schema : schemas_) {
    if (schema.name == name && schema.encoding == encoding && schema.data == data) return schema.id;
  }
  if (schemas_.size() >= kMostIds) return core::Error{file_.string() + ": more than 65535 schemas"};
  const Schema schema{static_cast<uint16_t>(schemas_.size() + 1), name, encoding, data};
  // Outside the chunks, so that a damaged chunk takes no other chunk's schema with it.
  Bytes record;
  append(record, schema);
  const auto status = put(record);
  if (!status.ok()) return status.error();
  schemas_.push_back(schema);
  ++statistics_.schemas;
  return schema.id;
}

core::Result<uint16_t> Writer::add_channel(uint16_t schema_id, const std::string& topic,
                                           const std::string& message_encoding,
                                           const std::map<std::string, std::string>& metadata) {
  if (schema_id > schemas_.size()) {
    return core::Error{file_.string() + ": channel " + topic + " names schema " + std::to_string(schema_id) +
                       ", which was not added"};
  }
  for (const Channel& channel : channels_) {
    if (channel.topic == topic && channel.schema_id == schema_id && channel.message_encoding == message_encoding &&
        channel.metadata == metadata) {
      return channel.id;
    }
  }
  if (channels_.size() >= kMostIds) return core::Error{file_.string() + ": more than 65535 channels"};
  const Channel channel{static_cast<uint16_t>(channels_.size() + 1), schema_id, topic, message_encoding, metadata};
  Bytes record;
  append(record, channel);
  const auto status = put(record);
  if (!status.ok()) return status.error();
  channels_.push_back(channel);
  ++statistics_.channels;
  return channel.id;
}

core::Status Writer::write(const Message& message) {
  if (message.channel_id == 0 || message.channel_id > channels_.size()) {
    return core::Error{file_.string() + ": a message names channel " + std::to_string(message.channel_id) +
                       ", which was not added"};
  }
  const size_t record_bytes = kRecordHeadBytes + kMessageHeadBytes + message.data.size();
  if (!chunk_.empty() && chunk_.size() + record_bytes > options_.chunk_bytes) {
    const auto status = flush_chunk();
    if (!status.ok()) return status;
  }
  if (chunk_.empty()) {
    chunk_head_ = {};
    chunk_head_.start_ns = chunk_head_.end_ns = message.log_time_ns;
    chunk_begun_ns_ = core::monotonic_ns();
  }
  chunk_head_.start_ns = std::min(chunk_head_.start_ns, message.log_time_ns);
  chunk_head_.end_ns = std::max(chunk_head_.end_ns, message.log_time_ns);
  chunk_messages_[message.channel_id].push_back({message.log_time_ns, chunk_.size()});
  append(chunk_, message);
  statistics_.count(message.channel_id, message.log_time_ns);
  // It is taken: a chunk that the disk refuses is tried again with the next message, in tick() and in close().
  (void)flush_old_chunk();
  sync_when_due();
  return {};
}

core::Status Writer::write_metadata(const Metadata& metadata) {
  Bytes record;
  append(record, metadata);
  const MetadataIndex index{offset_, record.size(), metadata.name};
  auto status = put(record);
  if (!status.ok()) return status;
  metadata_indexes_.push_back(index);
  ++statistics_.metadata;
  return {};
}

core::Status Writer::tick() {
  auto status = flush_old_chunk();
  sync_when_due();
  return status.ok() ? last_sync_ : status;
}

core::Status Writer::flush_old_chunk() {
  const int64_t age_ns = core::monotonic_ns() - chunk_begun_ns_;
  const bool old = options_.chunk_age_s > 0 && age_ns >= core::to_ns(options_.chunk_age_s);
  return old || chunk_.size() >= options_.chunk_bytes ? flush_chunk() : core::Status();
}

void Writer::sync_when_due() {
  const bool due =
      options_.sync_period_s > 0 && core::monotonic_ns() - synced_ns_ >= core::to_ns(options_.sync_period_s);
  if (due) sync_beside();
}

core::Status Writer::flush_chunk() {
  if (chunk_.empty()) return {};
  chunk_head_.uncompressed_bytes = chunk_.size();
  chunk_head_.crc = options_.chunk_crc ? crc32(chunk_) : 0;
  const Bytes packed = compress(chunk_, options_.compression);
  chunk_head_.compression = packed.empty() ? "" : name_of(options_.compression);
  const ByteView stored = packed.empty() ? ByteView(chunk_) : ByteView(packed);

  Bytes out;
  out.reserve(stored.size() + 64 + size_t{32} * statistics_.channels);
  append(out, chunk_head_, stored);
  ChunkIndex index{chunk_head_.start_ns,    chunk_head_.end_ns, offset_,      out.size(), {}, 0,
                   chunk_head_.compression, stored.size(),      chunk_.size()};
  Encoder encoder(out);
  for (const auto& [channel_id, entries] : chunk_messages_) {
    index.message_index_offsets[channel_id] = offset_ + out.size();
    const size_t record = encoder.begin_record(static_cast<uint8_t>(Opcode::message_index));
    encoder.u16(channel_id);
    const size_t array = encoder.begin_array();
    for (const IndexEntry& entry : entries) {
      encoder.time(entry.log_time_ns);
      encoder.u64(entry.offset);
    }
    encoder.end_array(array);
    encoder.end_record(record);
  }
  index.message_index_length = out.size() - index.length;
  auto status = put(out);
  if (!status.ok()) return status;
  chunk_indexes_.push_back(std::move(index));
  ++statistics_.chunks;
  chunk_.clear();
  chunk_messages_.clear();
  return {};
}

core::Status Writer::sync() {
  if (descriptor_ >= 0 && ::fdatasync(descriptor_) != 0) return io_error("cannot be forced to the disk", active_);
  return {};
}

// A busy disk takes seconds for this, and messages must not wait for it.
void Writer::sync_beside() {
  if (syncing_.valid() && syncing_.wait_for(std::chrono::seconds(0)) != std::future_status::ready) return;
  wait_for_sync();
  synced_ns_ = core::monotonic_ns();
  syncing_ = std::async(std::launch::async, [this] { return sync(); });
}

bool Writer::is_removed() const {
  struct stat ours {};
  return descriptor_ >= 0 && ::fstat(descriptor_, &ours) == 0 && ours.st_nlink == 0;
}

void Writer::wait_for_sync() {
  if (syncing_.valid()) last_sync_ = syncing_.get();
}

namespace {

/// Groups of summary records and the offsets that point at them.
class SummaryBuilder {
 public:
  explicit SummaryBuilder(uint64_t summary_start) : start_(summary_start) {}

  template <class Records>
  void group(Opcode opcode, const Records& records) {
    const size_t begin = bytes_.size();
    for (const auto& record : records) append(bytes_, record);
    if (bytes_.size() == begin) return;
    Encoder encoder(offsets_);
    const size_t record = encoder.begin_record(static_cast<uint8_t>(Opcode::summary_offset));
    encoder.u8(static_cast<uint8_t>(opcode));
    encoder.u64(start_ + begin);
    encoder.u64(bytes_.size() - begin);
    encoder.end_record(record);
  }
  /// Summary, offsets, footer and magic.
  Bytes finish() && {
    const uint64_t offset_start = start_ + bytes_.size();
    bytes_.insert(bytes_.end(), offsets_.begin(), offsets_.end());
    Encoder encoder(bytes_);
    const size_t record = encoder.begin_record(static_cast<uint8_t>(Opcode::footer));
    encoder.u64(start_);
    encoder.u64(offset_start);
    encoder.u32(0);
    encoder.end_record(record);
    const uint32_t crc = crc32(ByteView(bytes_).first(bytes_.size() - 4));
    bytes_.resize(bytes_.size() - 4);
    encoder.u32(crc);
    encoder.raw(kMagic);
    return std::move(bytes_);
  }

 private:
  uint64_t start_;
  Bytes bytes_;
  Bytes offsets_;
};

}  // namespace

core::Status Writer::write_tail() {
  Bytes data_end;
  Encoder encoder(data_end);
  const size_t record = encoder.begin_record(static_cast<uint8_t>(Opcode::data_end));
  encoder.u32(options_.data_crc ? data_crc_ : 0);
  encoder.end_record(record);
  SummaryBuilder summary(offset_ + data_end.size());
  summary.group(Opcode::schema, schemas_);
  summary.group(Opcode::channel, channels_);
  summary.group(Opcode::statistics, std::array{statistics_});
  summary.group(Opcode::chunk_index, chunk_indexes_);
  summary.group(Opcode::metadata_index, metadata_indexes_);
  encoder.raw(std::move(summary).finish());
  return put(data_end);
}

core::Status Writer::close() {
  if (descriptor_ < 0) return {};
  wait_for_sync();
  core::Status status = flush_chunk();
  if (status.ok()) status = write_tail();
  if (status.ok()) status = sync();
  if (descriptor_ >= 0 && ::close(descriptor_) != 0 && status.ok()) status = io_error("cannot be closed", active_);
  descriptor_ = -1;
  if (!status.ok()) return status;
  std::error_code failed;
  std::filesystem::rename(active_, file_, failed);
  if (failed)
    return core::Error{active_.string() + ": cannot be renamed to " + file_.string() + " (" + failed.message() + ")"};
  sync_folder(file_);
  return last_sync_;
}

}  // namespace railfix::mcap
