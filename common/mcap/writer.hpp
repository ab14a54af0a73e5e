// Writes MCAP recordings that survive a power cut: messages are collected in chunks, each chunk reaches the file in one
// write, and everything before it stays readable whatever happens after. While open the file is called
// NAME.mcap.active. Not thread safe: one thread owns a writer.
#pragma once

#include <cstdint>
#include <filesystem>
#include <future>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "core/result.hpp"
#include "mcap/compression.hpp"
#include "mcap/records.hpp"

namespace railfix::mcap {

struct WriterOptions {
  /// A chunk is closed when its records reach this many bytes; a larger message gets a chunk of its own.
  uint64_t chunk_bytes = uint64_t{1} << 20U;
  /// A chunk is closed when its first message has waited this long, so that a cut loses at most this (0 = by size
  /// only).
  double chunk_age_s = 1.0;
  /// Chunks that this makes smaller are stored so, others as they are.
  Compression compression = Compression::zstd;
  /// Every chunk carries a CRC of its records.
  bool chunk_crc = true;
  /// The data section carries a CRC too (one more pass over the stored bytes).
  bool data_crc = true;
  /// The file is forced to the disk (fsync) in this period, in a thread of its own (0 = only at the end).
  double sync_period_s = 5.0;
  /// An existing file of the same name, open or closed, is replaced; false refuses it.
  bool overwrite = false;
  /// Named in the file's header.
  std::string library = "railfix";
};

class Writer {
 public:
  /// Creates FILE.active. Error: the folder cannot be written, or the file exists.
  static core::Result<std::unique_ptr<Writer>> create(const std::filesystem::path& file, const WriterOptions& options);
  /// Closes the file if close() was not called; errors are lost then.
  ~Writer();
  Writer(const Writer&) = delete;
  Writer& operator=(const Writer&) = delete;

  /// Ids for messages. The same name, encoding and data give the same id again.
  core::Result<uint16_t> add_schema(const std::string& name, const std::string& encoding, const std::string& data);
  core::Result<uint16_t> add_channel(uint16_t schema_id, const std::string& topic, const std::string& message_encoding,
                                     const std::map<std::string, std::string>& metadata);
  /// Copies the data. Error: the message was not taken. (Here and below) the disk is full or gone: the file then ends
  /// behind its last whole record, and a later call may succeed.
  core::Status write(const Message& message);
  core::Status write_metadata(const Metadata& metadata);
  /// Closes a chunk that is too old and syncs when due; write() does the same, but what the disk says of it, and of
  /// the last sync until one succeeds, is said here and by close(): the messages were taken.
  core::Status tick();
  /// Writes summary and footer, syncs, and gives the file its final name.
  core::Status close();
  /// Closes the file, unless close() has given it its name, and removes it.
  void discard();

  /// Somebody has removed the file that is being written: what goes into it is gone when it is closed. One that was
  /// moved is not.
  [[nodiscard]] bool is_removed() const;

  [[nodiscard]] const std::filesystem::path& file() const { return file_; }
  [[nodiscard]] const Statistics& statistics() const { return statistics_; }
  /// On the disk, without the chunk being collected.
  [[nodiscard]] uint64_t bytes_written() const { return offset_; }

 private:
  struct IndexEntry {
    int64_t log_time_ns;
    uint64_t offset;
  };

  Writer(std::filesystem::path file, WriterOptions options) : file_(std::move(file)), options_(std::move(options)) {}
  core::Status put(ByteView bytes);
  core::Status flush_chunk();
  core::Status flush_old_chunk();
  void sync_when_due();
  core::Status sync();
  void sync_beside();
  void wait_for_sync();
  core::Status write_tail();

  std::filesystem::path file_;
  std::filesystem::path active_;
  WriterOptions options_;
  int descriptor_ = -1;
  uint64_t offset_ = 0;
  uint32_t data_crc_ = 0;
  int64_t synced_ns_ = 0;
  std::future<core::Status> syncing_;
  core::Status last_sync_;  // of those that have ended
  Bytes chunk_;
  ChunkHead chunk_head_;
  int64_t chunk_begun_ns_ = 0;
  std::map<uint16_t, std::vector<IndexEntry>> chunk_messages_;
  std::vector<Schema> schemas_;
  std::vector<Channel> channels_;
  std::vector<ChunkIndex> chunk_indexes_;
  std::vector<MetadataIndex> metadata_indexes_;
  Statistics statistics_;
};

}  // namespace railfix::mcap
