// The bytes of a file and the merge of its chunks into one stream of messages in time order.
#include <fcntl.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <limits>
#include <utility>

#include "mcap/reader.hpp"

namespace railfix::mcap {

namespace {

// Of a chunk that was not opened yet. Forwards it stands at the chunk's first time, backwards at its last, where it
// comes before every message of that time.
constexpr uint64_t kUnopened = std::numeric_limits<uint64_t>::max();

}  // namespace

core::Result<std::shared_ptr<FileBytes>> FileBytes::open(const std::filesystem::path& file) {
  const int descriptor = ::open(file.c_str(), O_RDONLY | O_CLOEXEC);
  struct stat info {};
  if (descriptor < 0 || ::fstat(descriptor, &info) != 0 || !S_ISREG(info.st_mode)) {
    const std::string why = descriptor < 0 ? std::strerror(errno) : "it is not a file";
    if (descriptor >= 0) ::close(descriptor);
    return core::Error{file.string() + " cannot be read (" + why + ")"};
  }
  return std::shared_ptr<FileBytes>(new FileBytes(descriptor, static_cast<uint64_t>(info.st_size)));
}

FileBytes::~FileBytes() {
  ::close(descriptor_);
}

std::optional<Bytes> FileBytes::read(uint64_t offset, uint64_t length) const {
  if (offset > size_ || length > size_ - offset) return std::nullopt;
  Bytes bytes(length);
  size_t done = 0;
  while (done < length) {
    const ssize_t got = ::pread(descriptor_, bytes.data() + done, length - done, static_cast<off_t>(offset + done));
    if (got < 0 && errno == EINTR) continue;
    if (got <= 0) return std::nullopt;
    done += static_cast<size_t>(got);
  }
  return bytes;
}

bool FileBytes::has_magic(uint64_t offset) const {
  const auto bytes = read(offset, kMagic.size());
  return bytes && std::ranges::equal(*bytes, kMagic);
}

bool being_written(const std::filesystem::path& file) {
  const int descriptor = ::open(file.c_str(), O_RDONLY | O_CLOEXEC);
  if (descriptor < 0) return false;
  const bool locked = ::flock(descriptor, LOCK_SH | LOCK_NB) != 0 && errno == EWOULDBLOCK;
  ::close(descriptor);
  return locked;
}

Messages::Messages(Reader& reader, Selection selection) : reader_(reader), selection_(std::move(selection)) {
  for (const auto& [id, channel] : reader_.channels_) {
    if (selection_.topics.empty() || selection_.topics.contains(channel.topic)) channels_.insert(id);
  }
  for (uint64_t i = 0; i < reader_.places_.size(); ++i) {
    const ChunkPlace& place = reader_.places_[i];
    if (selection_.from_ns && place.end_ns < *selection_.from_ns) continue;
    if (selection_.to_ns && place.start_ns >= *selection_.to_ns) continue;
    if (wanted(place)) heap_.push_back({selection_.backwards ? place.end_ns : place.start_ns, i, kUnopened});
  }
  std::ranges::make_heap(heap_, Behind{selection_.backwards});
}

bool Messages::wanted(const ChunkPlace& place) const {
  const auto wanted_channel = [this](uint16_t id) { return channels_.contains(id); };
  return place.channels.empty() || std::ranges::any_of(place.channels, wanted_channel);
}

bool Messages::wanted(const Message& message) const {
  return channels_.contains(message.channel_id) &&
         (!selection_.from_ns || message.log_time_ns >= *selection_.from_ns) &&
         (!selection_.to_ns || message.log_time_ns < *selection_.to_ns);
}

void Messages::open(uint64_t place) {
  const uint64_t free_bytes = selection_.most_held_bytes - std::min(held_bytes_, selection_.most_held_bytes);
  auto records = reader_.load(reader_.places_[place], free_bytes);
  if (!records) return;
  Loaded loaded{std::move(*records)};
  Decoder decoder(loaded.records);
  while (decoder.left() > 0) {
    const size_t position = decoder.position();
    const uint8_t opcode = decoder.u8();
    const ByteView content = decoder.raw(decoder.u64());
    Message message;
    if (!decoder.ok()) {
      reader_.problem("the chunk at byte " + std::to_string(reader_.places_[place].offset) +
                      " ends in a broken record");
      break;
    }
    if (opcode != static_cast<uint8_t>(Opcode::message) || !parse(content, message) || !wanted(message)) continue;
    heap_.push_back({message.log_time_ns, place, position});
    std::ranges::push_heap(heap_, Behind{selection_.backwards});
    ++loaded.left;
  }
  if (loaded.left == 0) return;
  loaded.held_bytes = loaded.records.size() + loaded.left * sizeof(Entry);
  held_bytes_ += loaded.held_bytes;
  loaded_.emplace(place, std::move(loaded));
}

void Messages::close(uint64_t place) {
  const auto loaded = loaded_.find(place);
  held_bytes_ -= loaded->second.held_bytes;
  loaded_.erase(loaded);
}

std::optional<Message> Messages::next() {
  if (finished_) close(*std::exchange(finished_, std::nullopt));
  while (!heap_.empty()) {
    std::ranges::pop_heap(heap_, Behind{selection_.backwards});
    const Entry entry = heap_.back();
    heap_.pop_back();
    if (entry.position == kUnopened) {
      if (wanted(reader_.places_[entry.place])) open(entry.place);
      continue;
    }
    Loaded& loaded = loaded_.at(entry.place);
    Decoder decoder(ByteView(loaded.records).subspan(entry.position + 1));
    Message message;
    (void)parse(decoder.raw(decoder.u64()), message);
    if (--loaded.left == 0) finished_ = entry.place;
    if (channels_.contains(message.channel_id)) return message;
    if (finished_) close(*std::exchange(finished_, std::nullopt));
  }
  return std::nullopt;
}

}  // namespace railfix::mcap
