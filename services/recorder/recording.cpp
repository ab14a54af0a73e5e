#include "recorder/recording.hpp"

#include <yaml-cpp/yaml.h>

#include <algorithm>
#include <array>
#include <cstdio>
#include <fstream>
#include <utility>

#include "core/time.hpp"

namespace railfix::recorder {

namespace {

namespace fs = std::filesystem;

constexpr int64_t kLossPeriodNs = 10 * core::kNsPerSecond;

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

core::Status Recording::write(const StoredSample& sample, int64_t log_time_ns) {
  const ChannelOf& channel = *sample.channel;
  auto known = channels_.find(sample.channel);
  if (known == channels_.end()) {
    const auto schema = writer_->add_schema(channel.type, "omgidl", channel.idl);
    if (!schema.ok()) return schema.error();
    const auto id = writer_->add_channel(schema.value(), channel.topic, "cdr", channel.metadata);
    if (!id.ok()) return id.error();
    known = channels_.emplace(sample.channel, id.value()).first;
  }
  auto status = writer_->write({known->second, sample.sequence, log_time_ns, sample.sent_ns, sample.cdr});
  if (!status.ok()) ++dropped_[{channel.topic, Loss::disk}];
  return status;
}

core::Status Recording::write_event(const EventNote& note) {
  return write_metadata(
      {"railfix_event", {{"time_ns", std::to_string(note.time_ns)}, {"text", note.text}, {"trigger", note.trigger}}});
}

void Recording::note_sequence(const std::string& topic, uint64_t writer, uint64_t sequence, bool exclusive) {
  gaps_[topic] += sequences_[topic].before(writer, sequence, exclusive);
}

void Recording::add_dropped(const std::string& topic, Loss cause, uint64_t count) {
  if (count > 0) dropped_[{topic, cause}] += count;
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

std::vector<TopicLosses> Recording::losses_by_topic() const {
  std::vector<TopicLosses> all;
  for (const auto& [what, count] : losses()) {
    if (all.empty() || all.back().topic != what.first) all.push_back({what.first, {}});
    all.back().by_cause[what.second] = count;
  }
  return all;
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

namespace {

// Anchors can make a circle.
constexpr int kMostDepth = 50;

bool is_secret(const YAML::Node& key) {
  return key.IsScalar() && (key.Scalar().ends_with("token") || key.Scalar().ends_with("password"));
}

/// False: nested too deeply.
bool hide_secrets(YAML::Node node, int depth) {
  if (depth > kMostDepth) return false;
  if (node.IsSequence()) {
    return std::all_of(node.begin(), node.end(), [&](const YAML::Node& one) { return hide_secrets(one, depth + 1); });
  }
  if (!node.IsMap()) return true;
  for (auto entry : node) {
    if (is_secret(entry.first)) {
      entry.second = "not recorded";
    } else if (!hide_secrets(entry.first, depth + 1) || !hide_secrets(entry.second, depth + 1)) {
      return false;
    }
  }
  return true;
}

}  // namespace

std::string without_secrets(const std::string& yaml) {
  try {
    const YAML::Node root = YAML::Load(yaml);
    if (root.IsMap() && hide_secrets(root, 0)) return YAML::Dump(root) + "\n";
  } catch (const YAML::Exception&) {  // its sentence may show the text
  }
  return "not recorded: it cannot be read as YAML, so nobody knows which words in it are secret\n";
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

}  // namespace railfix::recorder
