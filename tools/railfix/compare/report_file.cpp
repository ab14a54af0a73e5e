#include "compare/report_file.hpp"

#include <algorithm>
#include <cmath>
#include <fstream>
#include <nlohmann/json.hpp>

#include "core/csv.hpp"
#include "core/json_text.hpp"

namespace railfix::compare {

namespace {

namespace fs = std::filesystem;

core::Result<TimedReport> report_of(int64_t stamp_ns, const std::string& hex, int64_t baseline) {
  if (baseline != 3 && baseline != 4)
    return core::Error{"baseline must be 3 or 4, not " + std::to_string(baseline) + "."};
  if (const auto status = check_stamp(stamp_ns); !status.ok()) return status.error();
  const auto bytes = etcs::parse_hex(hex);
  if (!bytes.ok()) return bytes.error();
  auto fields = etcs::decode_or_advise(bytes.value(), static_cast<etcs::Baseline>(baseline), "baseline");
  if (!fields.ok()) return fields.error();
  return TimedReport{stamp_ns, std::move(fields).value()};
}

/// A row of a table with stamp, hex and, where the file says it, baseline.
core::Result<TimedReport> read_row(const core::CsvReader& table, size_t stamp, size_t hex,
                                   std::optional<size_t> baseline, etcs::Baseline otherwise) {
  const auto stamp_ns = table.integer(stamp);
  if (!stamp_ns.ok()) return stamp_ns.error();
  const auto given = baseline ? table.integer(*baseline) : static_cast<int64_t>(otherwise);
  if (!given.ok()) return given.error();
  auto report = report_of(stamp_ns.value(), std::string(table.text(hex)), given.value());
  return report.ok() ? report : table.error(report.error().message);
}

core::Result<ReportLog> read_table(const fs::path& file, etcs::Baseline baseline) {
  auto opened = core::CsvReader::open(file);
  if (!opened.ok()) return opened.error();
  auto& table = opened.value();
  const auto stamp = table.column({"stamp_ns", "time_ns"});
  const auto hex = table.column({"hex", "message"});
  if (!stamp || !hex)
    return core::Error{file.string() + " line 1: has no column '" + (stamp ? "hex" : "stamp_ns") + "'"};
  const auto given = table.column({"baseline"});
  ReportLog log;
  while (true) {
    if (table.next()) {
      log.take(read_row(table, *stamp, *hex, given, baseline));
    } else if (table.status().ok()) {
      return log;
    } else {
      log.lines_refused.push_back(table.status().error().message);
      if (!table.pass_over()) return table.status().error();
    }
  }
}

core::Result<TimedReport> read_line(const std::string& line, etcs::Baseline baseline) {
  const auto parsed = core::parse_json_strictly(line);
  if (!parsed.ok()) return parsed.error();
  const auto& json = parsed.value();
  if (!json.is_object()) return core::Error{"not a JSON object."};
  const auto stamp = json.contains("stamp_ns") ? json["stamp_ns"] : json.value("time_ns", nlohmann::json());
  const auto hex = json.contains("hex") ? json["hex"] : json.value("message", nlohmann::json());
  if (!stamp.is_number_integer()) return core::Error{"\"stamp_ns\" must be a whole number."};
  if (!hex.is_string()) return core::Error{"\"hex\" must be the message as text."};
  const auto given = json.value("baseline", nlohmann::json(static_cast<int>(baseline)));
  if (!given.is_number_integer()) return core::Error{"\"baseline\" must be 3 or 4."};
  return report_of(stamp.get<int64_t>(), hex.get<std::string>(), given.get<int64_t>());
}

core::Result<ReportLog> read_lines(const fs::path& file, etcs::Baseline baseline) {
  std::ifstream stream(file);
  if (!stream) return core::Error{file.string() + ": cannot be read; does it exist?"};
  ReportLog log;
  size_t number = 0;
  for (std::string line; std::getline(stream, line);) {
    ++number;
    if (line.find_first_not_of(" \t\r") == std::string::npos) continue;
    auto report = read_line(line, baseline);
    log.take(report.ok()
                 ? std::move(report)
                 : core::Error{file.string() + " line " + std::to_string(number) + ": " + report.error().message});
  }
  return log;
}

}  // namespace

core::Status check_stamp(int64_t stamp_ns) {
  constexpr int64_t kLastNs = 5'000'000'000'000'000'000;  // in the year 2128
  if (stamp_ns >= 0 && stamp_ns <= kLastNs) return {};
  return core::Error{"the stamp " + std::to_string(stamp_ns) + " is no time: nanoseconds since 1970 are from 0 to " +
                     std::to_string(kLastNs) + "."};
}

void ReportLog::take(core::Result<TimedReport> line) {
  if (line.ok()) {
    reports.push_back(std::move(line).value());
  } else {
    lines_refused.push_back(line.error().message);
  }
}

core::Result<ReportLog> read_reports(const fs::path& file, etcs::Baseline baseline) {
  const fs::path table = fs::is_directory(file) ? file / "tpr.csv" : file;
  auto log = table.extension() == ".jsonl" ? read_lines(table, baseline) : read_table(table, baseline);
  if (!log.ok()) return log;
  auto& [reports, refused] = log.value();
  if (reports.empty() && !refused.empty()) return core::Error{refused.front()};
  std::ranges::stable_sort(reports, {}, &TimedReport::stamp_ns);
  return log;
}

}  // namespace railfix::compare
