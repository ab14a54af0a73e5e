#include "recording/copy.hpp"

#include <algorithm>
#include <unordered_set>

#include "recording/copier.hpp"
#include "recording/part_in_time.hpp"
#include "recording/standing_values.hpp"

namespace railfix::tool {

namespace {

namespace fs = std::filesystem;

constexpr const char* kAbout = "railfix";
constexpr const char* kLosses = "railfix_losses";

bool named(const std::vector<std::string>& names, const std::string& topic) {
  return std::ranges::any_of(names,
                             [&](const std::string& name) { return topic == name || topic.starts_with(name + "/"); });
}

core::Result<std::set<std::string>> chosen_topics(const mcap::Reader& reader, const CutOptions& options) {
  std::set<std::string> topics;
  std::string all;
  for (const auto& [id, channel] : reader.channels()) {
    all += (all.empty() ? "" : ", ") + channel.topic;
    if ((options.topics.empty() || named(options.topics, channel.topic)) && !named(options.without, channel.topic)) {
      topics.insert(channel.topic);
    }
  }
  if (topics.empty()) {
    return core::Error{reader.file().string() + " has none of the wanted topics; it has " +
                       (all.empty() ? "none" : all)};
  }
  return topics;
}

void note_problems(const mcap::Reader& reader, CopyReport& report) {
  const auto problems = problems_of(reader);
  report.problems.insert(report.problems.end(), problems.begin(), problems.end());
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
  if (status.ok()) status = copier.close();
  if (!status.ok()) return status.error();
  report.topics = copier.topics();
  note_problems(reader, report);
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

/// Losses are counted on within a recording: its last word is its sum, and the sums add up.
core::Status write_metadata(Copier& copier, const std::vector<Source>& sources) {
  std::vector<mcap::Metadata> written;
  mcap::Metadata merged{"railfix_merge", {}};
  std::map<std::string, uint64_t> losses;
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
    for (const auto& [what, count] : last_losses->entries) losses[what] += std::strtoull(count.c_str(), nullptr, 10);
  }
  written.push_back(merged);
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

/// Tells samples from each other that are not the same one recorded twice.
class Seen {
 public:
  bool first(const mcap::Channel& channel, const mcap::Message& message) {
    mcap::Bytes what(channel.topic.begin(), channel.topic.end());
    mcap::Encoder encoder(what);
    encoder.time(message.publish_time_ns);
    encoder.u32(message.sequence);
    encoder.u32(mcap::crc32(message.data));
    const std::string_view text(reinterpret_cast<const char*>(what.data()), what.size());
    return hashes_.insert(std::hash<std::string_view>()(text)).second;
  }

 private:
  std::unordered_set<size_t> hashes_;
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
    if (seen.first(channel, *source->next)) {
      status = copier.write(*source->reader, channel, *source->next);
      ++report.samples;
    } else {
      ++report.duplicates;
    }
    source->next = source->messages->next();
  }
  if (status.ok()) status = copier.close();
  if (!status.ok()) return status.error();
  report.topics = copier.topics();
  for (const auto& source : sources.value()) note_problems(*source.reader, report);
  return report;
}

}  // namespace railfix::tool
