#include "recording/copy.hpp"

#include <algorithm>
#include <unordered_map>

#include "recording/copier.hpp"
#include "recording/part_in_time.hpp"
#include "recording/standing_values.hpp"
#include "recording/topic_names.hpp"

namespace railfix::tool {

namespace {

namespace fs = std::filesystem;

constexpr const char* kAbout = "railfix";
constexpr const char* kLosses = "railfix_losses";

core::Result<std::set<std::string>> chosen_topics(const mcap::Reader& reader, const CutOptions& options) {
  if (auto known = check_topics(reader, options.topics); !known.ok()) return known.error();
  if (auto known = check_left_out(reader, options.without); !known.ok()) return known.error();
  std::set<std::string> topics;
  for (const auto& [id, channel] : reader.channels()) {
    if ((options.topics.empty() || names_topic(options.topics, channel.topic)) &&
        !names_topic(options.without, channel.topic)) {
      topics.insert(channel.topic);
    }
  }
  if (topics.empty()) return core::Error{reader.file().string() + " has no topic that is wanted"};
  return topics;
}

/// How many samples that were, an index of the whole recording does not say of a part.
core::Status note_damage(const mcap::Reader& reader, Copier& copier, CopyReport& report) {
  const auto problems = problems_of(reader);
  report.problems.insert(report.problems.end(), problems.begin(), problems.end());
  auto lost = mcap::losses_of(reader, 0);
  lost.samples.reset();
  if (lost.chunks == 0 && lost.bytes == 0) return {};
  report.lost.chunks += lost.chunks;
  report.lost.bytes += lost.bytes;
  return copier.write(mcap::repair_trace(lost, reader.file()));
}

core::Result<mcap::Selection> part_of(const mcap::Reader& reader, const CutOptions& options) {
  auto part = part_in_time(reader, options.from_s, options.to_s);
  if (!part.ok()) return part;
  auto topics = chosen_topics(reader, options);
  if (!topics.ok()) return topics.error();
  part.value().topics = topics.value();
  return part;
}

core::Status write_standing(Copier& copier, mcap::Reader& reader, const mcap::Selection& part, CopyReport& report) {
  for (const auto& value : standing_values(reader, part.topics, *part.from_ns)) {
    const auto& channel = reader.channels().at(value.channel_id);
    auto status = copier.write(reader, channel, {0, value.sequence, *part.from_ns, value.publish_time_ns, value.cdr});
    if (!status.ok()) return status;
    ++report.standing;
  }
  return {};
}

}  // namespace

core::Result<CopyReport> cut_recording(const fs::path& file, const fs::path& out, const CutOptions& options) {
  auto opened = mcap::Reader::open(file);
  if (!opened.ok()) return opened.error();
  mcap::Reader& reader = *opened.value();
  const auto part = part_of(reader, options);
  if (!part.ok()) return part.error();
  auto created = Copier::create(out);
  if (!created.ok()) return created.error();
  Copier& copier = *created.value();
  CopyReport report;
  core::Status status;
  for (const auto& metadata : reader.metadata()) {
    if (status.ok()) status = copier.write(metadata);
  }
  const int64_t to_ns = part.value().to_ns.value_or(reader.statistics().end_ns + 1);
  if (status.ok()) {
    status = copier.write({"railfix_cut",
                           {{"file", file.filename().string()},
                            {"from_ns", std::to_string(*part.value().from_ns)},
                            {"to_ns", std::to_string(to_ns)}}});
  }
  if (status.ok()) status = write_standing(copier, reader, part.value(), report);
  if (!status.ok()) return status.error();
  reader.for_each(part.value(), [&](const mcap::Channel& channel, const mcap::Message& message) {
    status = copier.write(reader, channel, message);
    report.samples += status.ok() ? 1 : 0;
    return status.ok();
  });
  if (status.ok()) status = note_damage(reader, copier, report);
  if (status.ok()) status = copier.close();
  if (!status.ok()) return status.error();
  report.topics = copier.topics();
  return report;
}

namespace {

/// One of the recordings that become one.
struct Source {
  std::unique_ptr<mcap::Reader> reader;
  std::unique_ptr<mcap::Messages> messages;
  std::optional<mcap::Message> next;
};

std::string value_of(const mcap::Reader& reader, const std::string& key) {
  for (const auto& metadata : reader.metadata()) {
    if (metadata.name != kAbout) continue;
    if (const auto entry = metadata.entries.find(key); entry != metadata.entries.end()) return entry->second;
  }
  return "";
}

core::Result<std::vector<Source>> open_all(const std::vector<fs::path>& files) {
  std::vector<Source> sources;
  std::string train;
  for (const auto& file : files) {
    auto reader = mcap::Reader::open(file);
    if (!reader.ok()) return reader.error();
    const std::string here = value_of(*reader.value(), "train_id");
    if (!train.empty() && !here.empty() && here != train) {
      return core::Error{file.string() + " is of train " + here + ", " + files.front().string() + " of train " + train +
                         "; one recording is one train's"};
    }
    if (!here.empty()) train = here;
    sources.push_back({std::move(reader).value(), nullptr, {}});
  }
  for (auto& source : sources) {
    source.messages = std::make_unique<mcap::Messages>(source.reader->messages());
    source.next = source.messages->next();
  }
  return sources;
}

using LossCounts = std::map<std::string, uint64_t>;

LossCounts added_up(const std::map<std::string, LossCounts>& by_recording) {
  LossCounts sum;
  for (const auto& [recording, losses] : by_recording) {
    for (const auto& [what, count] : losses) sum[what] += count;
  }
  return sum;
}

/// One that says when it was begun is told from others; any other file is one of its own.
std::string recording_of(const Source& source) {
  const auto started = value_of(*source.reader, "started_ns");
  return started.empty() ? source.reader->file().string() : value_of(*source.reader, "train_id") + " " + started;
}

/// Losses are counted on within a recording: its last word is its sum, and the sums add up. Parts of one recording have
/// them in common.
core::Status write_metadata(Copier& copier, const std::vector<Source>& sources) {
  std::vector<mcap::Metadata> written;
  mcap::Metadata merged{"railfix_merge", {}};
  std::map<std::string, LossCounts> by_recording;
  for (const auto& source : sources) {
    merged.entries["file_" + std::to_string(merged.entries.size() + 1)] = source.reader->file().filename().string();
    const mcap::Metadata* last_losses = nullptr;
    for (const auto& metadata : source.reader->metadata()) {
      if (metadata.name == kLosses) {
        last_losses = &metadata;
      } else if (std::ranges::find(written, metadata) == written.end()) {
        written.push_back(metadata);
      }
    }
    if (last_losses == nullptr) continue;
    for (const auto& [what, count] : last_losses->entries) {
      uint64_t& most = by_recording[recording_of(source)][what];
      most = std::max<uint64_t>(most, std::strtoull(count.c_str(), nullptr, 10));
    }
  }
  written.push_back(merged);
  const auto losses = added_up(by_recording);
  if (!losses.empty()) {
    written.push_back({kLosses, {}});
    for (const auto& [what, count] : losses) written.back().entries[what] = std::to_string(count);
  }
  for (const auto& metadata : written) {
    auto status = copier.write(metadata);
    if (!status.ok()) return status;
  }
  return {};
}

/// Tells samples that another recording has given already.
class Seen {
 public:
  bool elsewhere(const mcap::Channel& channel, const mcap::Message& message, const mcap::Reader& source) {
    mcap::Bytes what(channel.topic.begin(), channel.topic.end());
    mcap::Encoder encoder(what);
    encoder.time(message.publish_time_ns);
    encoder.u32(message.sequence);
    encoder.u32(mcap::crc32(message.data));
    const std::string_view text(reinterpret_cast<const char*>(what.data()), what.size());
    return given_by_.try_emplace(std::hash<std::string_view>()(text), &source).first->second != &source;
  }

 private:
  std::unordered_map<size_t, const mcap::Reader*> given_by_;
};

Source* earliest(std::vector<Source>& sources) {
  Source* first = nullptr;
  for (auto& source : sources) {
    if (source.next && (first == nullptr || source.next->log_time_ns < first->next->log_time_ns)) first = &source;
  }
  return first;
}

}  // namespace

core::Result<CopyReport> merge_recordings(const std::vector<fs::path>& files, const fs::path& out) {
  for (const auto& file : files) {
    std::error_code failed;
    if (fs::equivalent(file, out, failed)) return core::Error{out.string() + " is one of the recordings to be merged"};
  }
  auto sources = open_all(files);
  if (!sources.ok()) return sources.error();
  auto created = Copier::create(out);
  if (!created.ok()) return created.error();
  Copier& copier = *created.value();
  auto status = write_metadata(copier, sources.value());
  CopyReport report;
  Seen seen;
  while (status.ok()) {
    Source* source = earliest(sources.value());
    if (source == nullptr) break;
    const auto& channel = source->reader->channels().at(source->next->channel_id);
    if (seen.elsewhere(channel, *source->next, *source->reader)) {
      ++report.duplicates;
    } else {
      status = copier.write(*source->reader, channel, *source->next);
      ++report.samples;
    }
    source->next = source->messages->next();
  }
  for (const auto& source : sources.value()) {
    if (status.ok()) status = note_damage(*source.reader, copier, report);
  }
  if (status.ok()) status = copier.close();
  if (!status.ok()) return status.error();
  report.topics = copier.topics();
  return report;
}

}  // namespace railfix::tool
