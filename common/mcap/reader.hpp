// Reads MCAP recordings, ours and others': by their index when the file was closed properly, else by a scan that finds
// every whole record of a truncated or damaged file. No content can crash it; what could not be read is said in
// problems(). Not thread safe.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <tuple>
#include <vector>

#include "core/result.hpp"
#include "mcap/records.hpp"

namespace railfix::mcap {

/// So many are told of one recording.
inline constexpr size_t kMostProblems = 100;

/// Where messages are stored: a Chunk record, or a run of Message records that stand outside chunks.
struct ChunkPlace {
  int64_t start_ns = 0;
  int64_t end_ns = 0;
  uint64_t offset = 0;
  uint64_t length = 0;
  bool loose = false;              // the run of records itself
  std::vector<uint16_t> channels;  // that have messages in it; empty = not known
};

class FileBytes {
 public:
  static core::Result<std::shared_ptr<FileBytes>> open(const std::filesystem::path& file);
  ~FileBytes();
  FileBytes(const FileBytes&) = delete;
  FileBytes& operator=(const FileBytes&) = delete;
  [[nodiscard]] uint64_t size() const { return size_; }
  /// Nothing when the range is not in the file or cannot be read.
  [[nodiscard]] std::optional<Bytes> read(uint64_t offset, uint64_t length) const;
  [[nodiscard]] bool has_magic(uint64_t offset) const;

 private:
  FileBytes(int descriptor, uint64_t size) : descriptor_(descriptor), size_(size) {}
  int descriptor_;
  uint64_t size_;
};

/// Which messages to read; everything by default. Topics that the file does not have give no messages.
struct Selection {
  std::set<std::string> topics;    // empty = all
  std::optional<int64_t> from_ns;  // log time, inclusive
  std::optional<int64_t> to_ns;    // log time, exclusive
  bool backwards = false;          // the newest first
  /// Held in memory of chunks that overlap in time; those beyond are lost. Room for the pictures of many cameras.
  uint64_t most_held_bytes = uint64_t{1} << 30U;
};

class Messages;

/// Asked again and again during work that takes minutes; empty = it goes on.
using GoesOn = std::function<bool()>;

class Reader {
 public:
  /// Error: the file cannot be opened or does not begin like an MCAP file, or `goes_on` says no while a damaged one is
  /// scanned. A damaged one opens, with problems().
  static core::Result<std::unique_ptr<Reader>> open(const std::filesystem::path& file, const GoesOn& goes_on = {});

  /// False: the file was not closed properly (cut off, or still being written), or its index is damaged.
  [[nodiscard]] bool closed() const { return closed_; }
  /// Read by its index; false, too, of a closed file whose writer left out what a reader needs.
  [[nodiscard]] bool indexed() const { return indexed_; }
  /// A sentence for everything that is missing or damaged, as far as it was met. Messages add to it while they are
  /// read.
  [[nodiscard]] const std::vector<std::string>& problems() const { return problems_; }
  /// Chunks that were wanted and cannot be used (their bytes by their place), and bytes that are no whole record.
  [[nodiscard]] const std::map<uint64_t, uint64_t>& lost_chunks() const { return lost_chunks_; }
  [[nodiscard]] uint64_t unread_bytes() const { return unread_bytes_; }
  [[nodiscard]] const std::map<uint16_t, Schema>& schemas() const { return schemas_; }
  [[nodiscard]] const std::map<uint16_t, Channel>& channels() const { return channels_; }
  [[nodiscard]] const std::vector<Metadata>& metadata() const { return metadata_; }
  /// As stored in an indexed file, else counted by the scan.
  [[nodiscard]] const Statistics& statistics() const { return statistics_; }
  [[nodiscard]] const std::filesystem::path& file() const { return file_; }

  /// Messages in the order of their log time, equal times in file order. REQUIRES: the reader outlives it.
  Messages messages(Selection selection = {});
  /// Calls `use` for every selected message, in the same order, until it returns false.
  void for_each(const Selection& selection,
                const std::function<bool(const Channel& channel, const Message& message)>& use);

 private:
  friend class Messages;
  Reader(std::filesystem::path file, std::shared_ptr<FileBytes> bytes)
      : file_(std::move(file)), bytes_(std::move(bytes)) {}
  struct Summary {
    bool counted = false;  // has statistics
    std::vector<MetadataIndex> metadata;
  };
  bool read_summary();
  bool read_summary_record(uint8_t opcode, ByteView content, Summary& summary);
  [[nodiscard]] bool suffices(const Summary& summary) const;
  void read_metadata(const std::vector<MetadataIndex>& indexes);
  /// False: `goes_on` says no.
  bool scan(const GoesOn& goes_on);
  /// The same; to the next whole chunk, or the end.
  bool skip_damage(uint64_t& offset, const GoesOn& goes_on);
  struct Record {
    uint8_t opcode = 0;
    Bytes content;
  };
  /// Nothing where no whole one can begin.
  [[nodiscard]] std::optional<Record> record_at(uint64_t offset) const;
  /// The next place where a whole chunk with a right checksum begins.
  [[nodiscard]] std::optional<uint64_t> chunk_behind(uint64_t offset, const GoesOn& goes_on) const;
  [[nodiscard]] bool is_whole_chunk(uint64_t offset) const;
  bool scan_record(uint8_t opcode, uint64_t offset, ByteView content);
  bool learn(uint8_t opcode, ByteView content);
  std::optional<Bytes> load(const ChunkPlace& place, uint64_t most_bytes);
  void problem(const std::string& what);

  std::filesystem::path file_;
  std::shared_ptr<FileBytes> bytes_;
  bool closed_ = false;
  bool indexed_ = false;
  std::vector<std::string> problems_;
  std::map<uint16_t, Schema> schemas_;
  std::map<uint16_t, Channel> channels_;
  std::vector<Metadata> metadata_;
  std::vector<ChunkPlace> places_;
  Statistics statistics_;
  std::map<uint64_t, uint64_t> lost_chunks_;
  uint64_t unread_bytes_ = 0;
};

/// Goes through a recording; holds only the chunks that overlap the present time in memory.
class Messages {
 public:
  /// The next message, or nothing at the end. Its data lives until the next call.
  std::optional<Message> next();
  /// No more messages of this channel; chunks that have no others of the selected are not read any more.
  void leave_out(uint16_t channel_id) { channels_.erase(channel_id); }

 private:
  friend class Reader;
  struct Entry {
    int64_t log_time_ns;
    uint64_t place;     // number of the chunk, in file order
    uint64_t position;  // of the record within the chunk; kUnopened for a chunk not yet loaded
    bool operator<(const Entry& other) const {
      return std::tie(log_time_ns, place, position) < std::tie(other.log_time_ns, other.place, other.position);
    }
  };
  /// The heap's order: true when a comes behind b.
  struct Behind {
    bool backwards;
    bool operator()(const Entry& a, const Entry& b) const { return backwards ? a < b : b < a; }
  };
  struct Loaded {
    Bytes records;
    size_t left = 0;
    uint64_t held_bytes = 0;  // with its entries in the heap
  };
  Messages(Reader& reader, Selection selection);
  void open(uint64_t place);
  void close(uint64_t place);
  [[nodiscard]] bool wanted(const ChunkPlace& place) const;
  [[nodiscard]] bool wanted(const Message& message) const;

  Reader& reader_;
  Selection selection_;
  std::set<uint16_t> channels_;
  std::vector<Entry> heap_;
  std::map<uint64_t, Loaded> loaded_;
  uint64_t held_bytes_ = 0;
  std::optional<uint64_t> finished_;  // chunk of the last message, to be dropped at the next call
};

/// A writer has this file open now (NAME.mcap.active of a running recorder).
bool being_written(const std::filesystem::path& file);

/// The metadata record of this name that stands before all messages; reads little of the file, also of an open one.
std::optional<Metadata> metadata_in_front(const std::filesystem::path& file, const std::string& name);

/// NAME-recovered.mcap beside NAME.mcap or NAME.mcap.active.
std::filesystem::path recovered_name(const std::filesystem::path& damaged);

/// Copies everything readable of a damaged or unfinished recording into a proper one, replacing what has that name; it
/// says in its metadata (railfix_repair) what is missing. Gives what could not be kept. Error: nothing of it is left;
/// so, too, when `goes_on` says no.
core::Result<std::vector<std::string>> recover(const std::filesystem::path& damaged, const std::filesystem::path& out,
                                               const GoesOn& goes_on = {});

}  // namespace railfix::mcap
