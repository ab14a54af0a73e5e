#include "recorder/recording.hpp"

#include <algorithm>
#include <array>
#include <cstdio>
#include <ctime>
#include <fstream>

#include "core/time.hpp"
#include "mcap/reader.hpp"

namespace railfix::recorder {

namespace {

namespace fs = std::filesystem;

constexpr int64_t kLossPeriodNs = 10 * core::kNsPerSecond;
constexpr const char* kActive = ".active";
constexpr const char* kRecovered = "-recovered";

std::string hex8(uint32_t value) {
  std::array<char, 9> text{};
  std::snprintf(text.data(), text.size(), "%08x", value);
  return text.data();
}

}  // namespace

const char* name_of(Loss cause) {
  switch (cause) {
    case Loss::transport:
      return "transport";
    case Loss::queue:
      return "queue";
    case Loss::encoder:
      return "encoder";
    case Loss::disk:
      return "disk";
  }
  return "unknown";
}

core::Result<std::unique_ptr<Recording>> Recording::create(const fs::path& file, const mcap::WriterOptions& options,
                                                           const std::map<std::string, std::string>& about) {
  std::error_code failed;
  if (file.has_parent_path()) fs::create_directories(file.parent_path(), failed);
  if (failed) return core::Error{file.parent_path().string() + " cannot be made (" + failed.message() + ")"};
  auto writer = mcap::Writer::create(file, options);
  if (!writer.ok()) return writer.error();
  std::unique_ptr<Recording> recording(new Recording(std::move(writer).value()));
  const auto status = recording->writer_->write_metadata({"railfix", about});
  if (!status.ok()) return status.error();
  return recording;
}

core::Status Recording::write(const ChannelOf& channel, const mcap::Message& sample) {
  auto known = channels_.find(channel.topic);
  if (known == channels_.end()) {
    const auto schema = writer_->add_schema(channel.type, "omgidl", channel.idl);
    if (!schema.ok()) return schema.error();
    const auto id = writer_->add_channel(schema.value(), channel.topic, "cdr", channel.metadata);
    if (!id.ok()) return id.error();
    known = channels_.emplace(channel.topic, id.value()).first;
  }
  mcap::Message message = sample;
  message.channel_id = known->second;
  auto status = writer_->write(message);
  if (!status.ok()) ++dropped_[{channel.topic, Loss::disk}];
  return status;
}

void Recording::note_sequence(const std::string& topic, uint64_t writer, uint64_t sequence) {
  const auto [last, first] = last_sequence_.try_emplace({topic, writer}, sequence);
  if (first) return;
  if (sequence > last->second + 1) gaps_[topic] += sequence - last->second - 1;
  last->second = std::max(last->second, sequence);
}

void Recording::set_dropped(const std::string& topic, Loss cause, uint64_t total) {
  if (total > 0) dropped_[{topic, cause}] = total;
}

Recording::Losses Recording::losses() const {
  Losses all = dropped_;
  for (const auto& [topic, gaps] : gaps_) {
    uint64_t explained = 0;
    for (const Loss cause : {Loss::queue, Loss::encoder}) {
      const auto dropped = dropped_.find({topic, cause});
      if (dropped != dropped_.end()) explained += dropped->second;
    }
    if (gaps > explained) all[{topic, Loss::transport}] = gaps - explained;
  }
  return all;
}

uint64_t Recording::lost_samples() const {
  uint64_t sum = 0;
  for (const auto& [what, count] : losses()) sum += count;
  return sum;
}

std::string Recording::loss_text() const {
  std::string text;
  std::string topic;
  for (const auto& [what, count] : losses()) {
    text += what.first == topic ? ", " : (text.empty() ? "" : "; ") + what.first + ": ";
    text += std::to_string(count) + " " + name_of(what.second);
    topic = what.first;
  }
  return text;
}

core::Status Recording::write_losses() {
  const uint64_t lost = lost_samples();
  if (lost == lost_written_) return {};
  mcap::Metadata metadata{"railfix_losses", {}};
  for (const auto& [what, count] : losses()) {
    metadata.entries[what.first + " " + name_of(what.second)] = std::to_string(count);
  }
  lost_written_ = lost;
  return writer_->write_metadata(metadata);
}

core::Status Recording::tick(int64_t now_monotonic_ns) {
  if (now_monotonic_ns - losses_written_ns_ >= kLossPeriodNs) {
    losses_written_ns_ = now_monotonic_ns;
    auto status = write_losses();
    if (!status.ok()) return status;
  }
  return writer_->tick();
}

core::Status Recording::close() {
  const auto status = write_losses();
  const auto closed = writer_->close();
  return status.ok() ? closed : status;
}

std::string fingerprint(const fs::path& file) {
  if (file.empty()) return "";
  std::ifstream stream(file, std::ios::binary);
  if (!stream) return file.string() + " not readable";
  uint32_t crc = 0;
  std::array<char, 65536> block{};
  while (stream.read(block.data(), block.size()) || stream.gcount() > 0) {
    crc = mcap::crc32({reinterpret_cast<const uint8_t*>(block.data()), static_cast<size_t>(stream.gcount())}, crc);
  }
  return file.filename().string() + " crc32 " + hex8(crc);
}

fs::path new_name(const fs::path& folder, const std::string& train_id, int64_t now_ns) {
  const auto now_s = static_cast<time_t>(now_ns / core::kNsPerSecond);
  tm utc{};
  gmtime_r(&now_s, &utc);
  std::array<char, 32> stamp{};
  (void)std::strftime(stamp.data(), stamp.size(), "%Y%m%d-%H%M%S", &utc);
  std::string train = train_id;
  std::ranges::replace(train, '/', '_');
  const std::string base = train + "-" + stamp.data();
  fs::path file = folder / (base + ".mcap");
  for (int i = 2; fs::exists(file) || fs::exists(file.string() + kActive); ++i) {
    file = folder / (base + "-" + std::to_string(i) + ".mcap");
  }
  return file;
}

std::vector<std::string> recover_folder(const fs::path& folder) {
  std::vector<std::string> sentences;
  std::error_code failed;
  for (const auto& entry : fs::directory_iterator(folder, failed)) {
    const fs::path active = entry.path();
    if (active.extension() != kActive || active.stem().extension() != ".mcap" || mcap::being_written(active)) continue;
    const std::string base = active.stem().stem().string();
    // A recovery that was itself cut off: its source is still there and is recovered again.
    if (base.ends_with(kRecovered)) continue;
    const fs::path name = mcap::recovered_name(active);
    const auto lost = mcap::recover(active, name);
    if (!lost.ok()) {
      sentences.push_back(active.string() + " was left by a crash and cannot be recovered: " + lost.error().message);
      continue;
    }
    fs::remove(active, failed);
    sentences.push_back(active.string() + " was left by a crash; what it held is now in " + name.string());
  }
  return sentences;
}

std::vector<std::string> keep_quota(const fs::path& folder, uint64_t most_bytes) {
  struct Old {
    fs::file_time_type time;
    fs::path file;
    uint64_t bytes;
  };
  std::vector<Old> all;
  uint64_t sum = 0;
  std::error_code failed;
  for (const auto& entry : fs::directory_iterator(folder, failed)) {
    if (entry.path().extension() != ".mcap" || !entry.is_regular_file(failed)) continue;
    all.push_back({entry.last_write_time(failed), entry.path(), entry.file_size(failed)});
    sum += all.back().bytes;
  }
  std::ranges::sort(all, {}, &Old::time);
  std::vector<std::string> removed;
  for (const Old& old : all) {
    if (sum < most_bytes) break;
    if (!fs::remove(old.file, failed)) continue;
    sum -= old.bytes;
    removed.push_back(old.file.string() + " was removed to keep the quota");
  }
  return removed;
}

}  // namespace railfix::recorder
