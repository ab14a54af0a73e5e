// `railfix recording info`.
#include <spdlog/fmt/fmt.h>

#include <iostream>
#include <memory>
#include <nlohmann/json.hpp>

#include "command_recording.hpp"
#include "core/json_text.hpp"
#include "core/time.hpp"
#include "mcap/check.hpp"
#include "recording/sample_types.hpp"
#include "recording/topic_summary.hpp"
#include "recording/utc_text.hpp"

namespace railfix::tool {

namespace {

namespace fs = std::filesystem;
using nlohmann::ordered_json;

constexpr double kBytesPerMb = 1e6;

struct InfoOptions {
  fs::path file;
  bool quick = false;
  bool json = false;
};

struct Info {
  std::unique_ptr<mcap::Reader> reader;
  std::optional<mcap::Check> check;  // nothing when it was not asked for
  std::vector<std::string> problems;
};

Info read(const InfoOptions& options) {
  Info info{core::value_or_throw(mcap::Reader::open(options.file)), {}, {}};
  if (!options.quick) {
    info.check = core::value_or_throw(mcap::check(options.file));
    for (const auto& problem : info.check->problems) info.problems.push_back(options.file.string() + ": " + problem);
  }
  if (info.problems.empty()) info.problems = info.reader->problems();
  return info;
}

/// Losses are counted on: the last word is the sum.
std::map<std::string, std::string> losses_of(const mcap::Reader& reader) {
  std::map<std::string, std::string> losses;
  for (const auto& metadata : reader.metadata()) {
    if (metadata.name == "railfix_losses") losses = metadata.entries;
  }
  return losses;
}

/// By the index alone: when the topic was heard is not known.
double rate_hz(const mcap::Channel& channel, uint64_t messages, const mcap::Statistics& statistics) {
  const double length_s = core::seconds(statistics.end_ns - statistics.start_ns);
  const uint64_t counted = periodic(channel) && messages > 1 ? messages - 1 : messages;
  return length_s > 0 ? static_cast<double>(counted) / length_s : 0;
}

void add_content(ordered_json& topic, const Info& info, const mcap::Channel& channel) {
  const auto found = info.check->channels.find(channel.id);
  const bool heard = found != info.check->channels.end() && found->second.messages > 0;
  const auto content = heard ? found->second : mcap::ChannelContent{};
  const auto& statistics = info.reader->statistics();
  const auto summary = heard ? summary_of(channel, content, {statistics.start_ns, statistics.end_ns}) : TopicSummary{};
  topic["samples"] = content.messages;
  topic["rate_hz"] = summary.rate_hz;
  topic["bytes"] = content.bytes;
  topic["longest_gap_s"] = summary.longest_gap_s;
  topic["longest_gap_between_samples_s"] = summary.between_s;
  topic["periodic"] = periodic(channel);
  topic["begins_s"] = heard ? ordered_json(summary.begins_s) : ordered_json();
  topic["ends_s"] = heard ? ordered_json(summary.ends_s) : ordered_json();
  topic["begins_late"] = summary.begins_late;
  topic["ends_early"] = summary.ends_early;
}

ordered_json topic_json(const Info& info, const mcap::Channel& channel) {
  const auto& statistics = info.reader->statistics();
  const auto counted = statistics.channel_messages.find(channel.id);
  const uint64_t messages = counted == statistics.channel_messages.end() ? 0 : counted->second;
  const auto schema = info.reader->schemas().find(channel.schema_id);
  ordered_json topic{{"topic", channel.topic},
                     {"type", schema == info.reader->schemas().end() ? "" : schema->second.name},
                     {"latched", latched(channel)},
                     {"samples", messages},
                     {"rate_hz", rate_hz(channel, messages, statistics)}};
  if (info.check) add_content(topic, info, channel);
  return topic;
}

/// Those that are there, so that the topics' add up to them.
uint64_t samples_of(const Info& info) {
  if (!info.check) return info.reader->statistics().messages;
  uint64_t samples = 0;
  for (const auto& [id, channel] : info.reader->channels()) {
    const auto content = info.check->channels.find(id);
    if (content != info.check->channels.end()) samples += content->second.messages;
  }
  return samples;
}

ordered_json json_of(const InfoOptions& options, const Info& info) {
  const auto& statistics = info.reader->statistics();
  const auto when = [&](int64_t ns) { return statistics.messages > 0 ? ordered_json(utc_text(ns)) : ordered_json(); };
  const auto by_index = info.reader->indexed() ? ordered_json(statistics.messages) : ordered_json();
  ordered_json json{
      {"file", options.file.string()},   {"bytes", fs::file_size(options.file)},
      {"closed", info.reader->closed()}, {"from", when(statistics.start_ns)},
      {"to", when(statistics.end_ns)},   {"from_ns", statistics.start_ns},
      {"to_ns", statistics.end_ns},      {"duration_s", core::seconds(statistics.end_ns - statistics.start_ns)},
      {"samples", samples_of(info)},     {"samples_by_index", by_index},
      {"chunks", statistics.chunks},     {"topics", ordered_json::array()},
      {"lost", losses_of(*info.reader)}, {"metadata", ordered_json::array()}};
  std::multimap<std::string, ordered_json> by_name;
  for (const auto& [id, channel] : info.reader->channels()) by_name.emplace(channel.topic, topic_json(info, channel));
  for (const auto& [name, topic] : by_name) json["topics"].push_back(topic);
  for (const auto& metadata : info.reader->metadata()) {
    json["metadata"].push_back({{"name", metadata.name}, {"entries", metadata.entries}});
  }
  if (info.check) {
    json["check"] = {{"sound", info.check->problems.empty()},
                     {"chunks_with_checksum", info.check->chunks_with_crc},
                     {"data_checksum", info.check->data_crc},
                     {"index_checksum", info.check->summary_crc}};
  }
  json["problems"] = info.problems;
  return json;
}

std::string seconds_if(bool told, const ordered_json& value) {
  return told ? fmt::format("{:.1f}", value.get<double>()) : "";
}

/// When a topic begins and ends stands there only where it is not with the recording.
void print_topics(const ordered_json& topics, bool checked) {
  std::printf("%-28s %9s %9s %s  %s\n", "topic", "samples", "rate Hz",
              checked ? "     MB    gap s   from s     to s" : "", "type");
  for (const auto& topic : topics) {
    std::printf("%-28s %9llu %9.2f ", topic["topic"].get<std::string>().c_str(),
                static_cast<unsigned long long>(topic["samples"].get<uint64_t>()), topic["rate_hz"].get<double>());
    if (checked) {
      std::printf("%8.2f %8.2f %8s %8s", topic["bytes"].get<double>() / kBytesPerMb,
                  topic["longest_gap_s"].get<double>(), seconds_if(topic["begins_late"], topic["begins_s"]).c_str(),
                  seconds_if(topic["ends_early"], topic["ends_s"]).c_str());
    }
    std::printf("  %s%s\n", topic["type"].get<std::string>().c_str(), topic["latched"].get<bool>() ? ", latched" : "");
  }
}

std::string amount_of(const ordered_json& json) {
  const auto samples = json["samples"].get<uint64_t>();
  const auto chunks = json["chunks"].get<uint64_t>();
  const auto& by_index = json["samples_by_index"];
  if (by_index.is_null() || by_index == samples) return fmt::format("{} samples in {} chunks", samples, chunks);
  return fmt::format("{} samples can be counted; by its index there were {} in {} chunks", samples,
                     by_index.get<uint64_t>(), chunks);
}

void print(const ordered_json& json) {
  std::printf("%s: %.1f MB, %s\n", json["file"].get<std::string>().c_str(), json["bytes"].get<double>() / kBytesPerMb,
              json["closed"].get<bool>() ? "closed properly" : "NOT closed properly");
  if (json["from"].is_null()) {
    std::printf("no samples\n\n");
  } else {
    std::printf("from %s, %.1f s, %s\n\n", json["from"].get<std::string>().c_str(), json["duration_s"].get<double>(),
                amount_of(json).c_str());
  }
  print_topics(json["topics"], json.contains("check"));
  std::printf("\n");
  for (const auto& metadata : json["metadata"]) {
    if (metadata["name"] == "railfix_losses") continue;
    std::printf("%s:", metadata["name"].get<std::string>().c_str());
    for (const auto& [key, value] : metadata["entries"].items()) {
      std::printf(" %s=%s", key.c_str(), value.get<std::string>().c_str());
    }
    std::printf("\n");
  }
  std::printf("lost while recording:%s\n", json["lost"].empty() ? " nothing" : "");
  for (const auto& [what, count] : json["lost"].items()) {
    std::printf("  %s: %s\n", what.c_str(), count.get<std::string>().c_str());
  }
  if (!json.contains("check")) return;
  std::printf("check: %s\n", json["problems"].empty() ? "every checksum, index entry and count is right" : "PROBLEMS");
  for (const auto& problem : json["problems"]) std::printf("  %s\n", problem.get<std::string>().c_str());
  if (!json["problems"].empty())
    std::printf("railfix recording repair makes a proper file of everything in whole chunks\n");
}

int info(const InfoOptions& options) {
  const Info all = read(options);
  const auto json = json_of(options, all);
  if (options.json) {
    std::cout << core::json_text(json, 2) << '\n';
  } else {
    print(json);
  }
  return all.problems.empty() ? 0 : 1;
}

}  // namespace

void add_recording_info(CLI::App& recording, Action& chosen) {
  auto options = std::make_shared<InfoOptions>();
  auto* command = recording.add_subcommand(
      "info",
      "What is in a recording, what was lost, and whether every checksum is right (1 when not), e.g. railfix recording "
      "info run.mcap");
  command->add_option("file", options->file, "The recording")->required();
  command->add_flag("--quick", options->quick, "By its index only, without reading all of it");
  command->add_flag("--json", options->json, "JSON on standard output");
  command->callback([options, &chosen] { chosen = [options] { return info(*options); }; });
}

}  // namespace railfix::tool
