#include "compare/report_file.hpp"

#include <algorithm>
#include <cmath>
#include <fstream>
#include <nlohmann/json.hpp>

#include "core/csv_table.hpp"
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

core::Result<std::vector<TimedReport>> read_table(const fs::path& file, etcs::Baseline baseline) {
  core::CsvTable table(file);
  const size_t stamp = table.required({"stamp_ns", "time_ns"});
  const size_t hex = table.required({"hex", "message"});
  const auto given = table.optional({"baseline"});
  std::vector<TimedReport> reports;
  while (table.next()) {
    auto report = report_of(table.integer(stamp), table.text(hex),
                            given ? table.integer(*given) : static_cast<int64_t>(baseline));
    if (report.ok()) {
      reports.push_back(std::move(report).value());
    } else {
      table.refuse(report.error().message);
    }
  }
  if (!table.status().ok()) return table.status().error();
  return reports;
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

core::Result<std::vector<TimedReport>> read_lines(const fs::path& file, etcs::Baseline baseline) {
  std::ifstream stream(file);
  if (!stream) return core::Error{file.string() + ": cannot be read; does it exist?"};
  std::vector<TimedReport> reports;
  size_t number = 0;
  for (std::string line; std::getline(stream, line);) {
    ++number;
    if (line.find_first_not_of(" \t\r") == std::string::npos) continue;
    auto report = read_line(line, baseline);
    if (!report.ok())
      return core::Error{file.string() + " line " + std::to_string(number) + ": " + report.error().message};
    reports.push_back(std::move(report).value());
  }
  return reports;
}

}  // namespace

core::Status check_stamp(int64_t stamp_ns) {
  constexpr int64_t kLastNs = 5'000'000'000'000'000'000;  // in the year 2128
  if (stamp_ns >= 0 && stamp_ns <= kLastNs) return {};
  return core::Error{"the stamp " + std::to_string(stamp_ns) + " is no time: nanoseconds since 1970 are from 0 to " +
                     std::to_string(kLastNs) + "."};
}

core::Result<std::vector<TimedReport>> read_reports(const fs::path& file, etcs::Baseline baseline) {
  const fs::path table = fs::is_directory(file) ? file / "tpr.csv" : file;
  auto reports = table.extension() == ".jsonl" ? read_lines(table, baseline) : read_table(table, baseline);
  if (!reports.ok()) return reports;
  std::stable_sort(reports.value().begin(), reports.value().end(),
                   [](const TimedReport& a, const TimedReport& b) { return a.stamp_ns < b.stamp_ns; });
  return reports;
}

}  // namespace railfix::compare
