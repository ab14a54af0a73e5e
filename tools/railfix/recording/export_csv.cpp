#include "recording/export_csv.hpp"

#include <algorithm>

#include "cdr/decode.hpp"
#include "core/csv.hpp"
#include "recording/sample_types.hpp"

namespace railfix::tool {

namespace {

using nlohmann::ordered_json;

std::string csv_text(const std::string& text) {
  if (text.find_first_of(",\"\n\r") == std::string::npos) return text;
  std::string out = "\"";
  for (const char c : text) {
    if (c == '"') out += '"';
    out += c;
  }
  return out + "\"";
}

std::string text_of(const ordered_json& value) {
  if (value.is_null() || (value.is_number_float() && std::isnan(value.get<double>()))) return "";
  return value.is_string() ? value.get<std::string>() : value.dump();
}

std::string cell_of(const ordered_json& value) {
  if (!value.is_array()) return csv_text(text_of(value));
  if (std::ranges::any_of(value, [](const ordered_json& one) { return one.is_structured(); })) {
    return csv_text(value.dump());
  }
  std::string cell;
  for (const auto& one : value) cell += (cell.empty() ? "" : ";") + text_of(one);
  return csv_text(cell);
}

/// One topic's file.
class Table {
 public:
  Table(const std::filesystem::path& file, const cdr::Structure& type) : csv_(file, header(type)) {}
  void add(const mcap::Message& message, const ordered_json& sample) {
    csv_ << message.log_time_ns << message.publish_time_ns << message.sequence;
    for (const auto& [name, value] : sample.items()) csv_ << cell_of(value);
    csv_.end_row();
  }
  [[nodiscard]] bool whole() const { return csv_.whole(); }
  core::Status close() { return csv_.close(); }

 private:
  static std::string header(const cdr::Structure& type) {
    std::string header = "log_time_ns,publish_time_ns,sequence";
    for (const auto& member : type.members) {
      if (member.name != "padding") header += "," + member.name;
    }
    return header;
  }
  core::CsvWriter csv_;
};

std::filesystem::path file_of(const std::filesystem::path& folder, std::string topic) {
  std::ranges::replace(topic, '/', '_');
  return folder / (topic + ".csv");
}

}  // namespace

core::Result<CsvReport> export_csv(mcap::Reader& reader, const mcap::Selection& part,
                                   const std::filesystem::path& folder) {
  std::error_code failed;
  std::filesystem::create_directories(folder, failed);
  if (failed) return core::Error{folder.string() + " cannot be made (" + failed.message() + ")"};
  SampleTypes types(reader);
  const cdr::DecodeOptions options{.name_constants = true};
  std::map<std::string, std::unique_ptr<Table>> tables;
  std::map<std::string, uint64_t> unreadable;
  CsvReport report;
  try {
    reader.for_each(part, [&](const mcap::Channel& channel, const mcap::Message& message) {
      const auto* type = types.structure(channel);
      const auto sample = type == nullptr ? core::Result<ordered_json>(core::Error{})
                                          : cdr::decode(*types.types(channel), type->name, message.data, options);
      if (!sample.ok()) {
        ++unreadable[channel.topic];
        return true;
      }
      auto& table = tables[channel.topic];
      if (!table) table = std::make_unique<Table>(file_of(folder, channel.topic), *type);
      table->add(message, sample.value());
      ++report.rows;
      return table->whole();  // on a full disk it would read on for hours
    });
    core::Status status;
    for (const auto& [topic, table] : tables) {
      if (const auto closed = table->close(); status.ok()) status = closed;
    }
    if (!status.ok()) return core::Error{"the tables in " + folder.string() + " are cut: " + status.error().message};
  } catch (const core::BadInput& error) {
    return core::Error{error.what()};
  }
  report.tables = tables.size();
  for (const auto& [topic, count] : unreadable) {
    report.problems.push_back(topic + ": " + std::to_string(count) +
                              " samples do not fit the type that the recording describes and were left out");
  }
  return report;
}

}  // namespace railfix::tool
