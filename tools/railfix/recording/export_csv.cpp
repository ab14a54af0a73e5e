#include "recording/export_csv.hpp"

#include <algorithm>

#include "cdr/decode.hpp"
#include "core/csv.hpp"
#include "core/whole_file.hpp"
#include "recording/sample_types.hpp"

namespace railfix::tool {

namespace {

namespace fs = std::filesystem;
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
  const double number = value.is_number_float() ? value.get<double>() : 0;
  if (value.is_null() || std::isnan(number)) return "";
  if (std::isinf(number)) return number > 0 ? "inf" : "-inf";  // JSON has no word for it
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
  Table(const fs::path& file, const std::string& header) : csv_(file, header) {}
  void add(const mcap::Message& message, const ordered_json& sample) {
    csv_ << message.log_time_ns << message.publish_time_ns << message.sequence;
    for (const auto& [name, value] : sample.items()) csv_ << cell_of(value);
    csv_.end_row();
  }
  [[nodiscard]] bool whole() const { return csv_.whole(); }
  core::Status close() { return csv_.close(); }

 private:
  core::CsvWriter csv_;
};

std::string header_of(const cdr::Structure& type) {
  std::string header = "log_time_ns,publish_time_ns,sequence";
  for (const auto& member : type.members) {
    if (member.name != "padding") header += "," + member.name;
  }
  return header;
}

/// All tables of one export, in their places or none: each has a name of its own until all are whole.
class Tables {
 public:
  explicit Tables(fs::path folder) : folder_(std::move(folder)) {}
  ~Tables() {
    if (kept_) return;
    std::error_code failed;
    for (const auto& [name, table] : tables_) {
      fs::remove(draft_of(name), failed);
      fs::remove(file_of(name), failed);
    }
    if (made_) fs::remove(folder_, failed);  // only if nothing else is in it
  }
  Tables(const Tables&) = delete;
  Tables& operator=(const Tables&) = delete;

  core::Status make_folder() {
    std::error_code failed;
    made_ = fs::create_directories(folder_, failed);
    return failed ? core::Status(core::Error{folder_.string() + " cannot be made (" + failed.message() + ")"})
                  : core::Status();
  }
  /// A version of the topic's type that has other columns has a table of its own: TOPIC, TOPIC-2, ...
  Table& of(const std::string& topic, const cdr::Structure& type) {
    auto*& table = table_of_[{topic, &type}];
    if (table == nullptr) table = &of(topic, header_of(type));
    return *table;
  }
  core::Status keep() {
    for (const auto& [name, table] : tables_) {
      if (auto closed = table->close(); !closed.ok()) return closed;
    }
    for (const auto& [name, table] : tables_) {
      if (auto moved = core::move_draft(draft_of(name), file_of(name)); !moved.ok()) return moved;
    }
    kept_ = true;
    return {};
  }
  void tell_versions(std::vector<std::string>& problems) const {
    for (const auto& [topic, versions] : versions_) {
      if (versions.size() > 1)
        problems.push_back(topic + ": its type changed; each version has a table of its own, the last is " +
                           file_of(topic + "-" + std::to_string(versions.size())).string());
    }
  }
  [[nodiscard]] size_t size() const { return tables_.size(); }

 private:
  Table& of(const std::string& topic, const std::string& header) {
    auto& versions = versions_[topic];
    const auto found = std::ranges::find(versions, header);
    const auto number = found - versions.begin() + 1;
    if (found == versions.end()) versions.push_back(header);
    const auto [place, is_new] = tables_.try_emplace(number == 1 ? topic : topic + "-" + std::to_string(number));
    if (is_new) place->second = std::make_unique<Table>(draft_of(place->first), header);
    return *place->second;
  }
  [[nodiscard]] fs::path file_of(std::string name) const {
    std::ranges::replace(name, '/', '_');
    return folder_ / (name + ".csv");
  }
  [[nodiscard]] fs::path draft_of(const std::string& name) const { return file_of(name).string() + ".draft"; }

  fs::path folder_;
  bool made_ = false;
  bool kept_ = false;
  std::map<std::string, std::unique_ptr<Table>> tables_;
  std::map<std::string, std::vector<std::string>> versions_;  // headers, by topic
  std::map<std::pair<std::string, const cdr::Structure*>, Table*> table_of_;
};

}  // namespace

core::Result<CsvReport> export_csv(mcap::Reader& reader, const mcap::Selection& part, const fs::path& folder,
                                   const mcap::GoesOn& goes_on) {
  Tables tables(folder);
  if (const auto made = tables.make_folder(); !made.ok()) return made.error();
  SampleTypes types(reader);
  const cdr::DecodeOptions options{.name_constants = true};
  std::map<std::pair<std::string, std::string>, uint64_t> unreadable;  // by topic and why
  bool stopped = false;
  CsvReport report;
  try {
    reader.for_each(part, [&](const mcap::Channel& channel, const mcap::Message& message) {
      stopped = goes_on && !goes_on();
      if (stopped) return false;
      const auto* type = types.structure(channel);
      const auto sample = type == nullptr ? core::Result<ordered_json>(core::Error{})
                                          : cdr::decode(*types.types(channel), type->name, message.data, options);
      if (!sample.ok()) {
        ++unreadable[{channel.topic, type == nullptr ? types.why_unknown(channel)
                                                     : "they do not fit the type that the recording describes"}];
        return true;
      }
      Table& table = tables.of(channel.topic, *type);
      table.add(message, sample.value());
      ++report.rows;
      return table.whole();  // on a full disk it would read on for hours
    });
    if (stopped) return core::Error{"writing tables into " + folder.string() + " was stopped"};
    if (const auto kept = tables.keep(); !kept.ok())
      return core::Error{"there are no tables in " + folder.string() + ": " + kept.error().message};
  } catch (const core::BadInput& error) {
    return core::Error{error.what()};
  }
  report.tables = tables.size();
  tables.tell_versions(report.problems);
  for (const auto& [of, count] : unreadable) {
    const auto& [topic, why] = of;
    report.problems.push_back(topic + ": " + std::to_string(count) + " samples were left out; " + why);
  }
  return report;
}

}  // namespace railfix::tool
