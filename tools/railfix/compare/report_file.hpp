// Train position reports of one system, from a file.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "core/result.hpp"
#include "etcs/train_position_report.hpp"

namespace railfix::compare {

struct TimedReport {
  int64_t stamp_ns = 0;  // of the position, in the time that both systems share
  etcs::TrainPositionReport fields;
  bool operator==(const TimedReport&) const = default;
};

/// What a file says.
struct ReportLog {
  std::vector<TimedReport> reports;        // sorted by time
  std::vector<std::string> lines_refused;  // a sentence each, with file and line

  void take(core::Result<TimedReport> line);
};

/// A stamp must be from 1970 on, and so early that an offset between two clocks may be added.
core::Status check_stamp(int64_t stamp_ns);

/// A table with `stamp_ns` and `hex` (tpr.csv of a run; `time_ns` and `message` are understood too), a run's folder, or
/// .jsonl: one object a line with the same keys, as `railfix tpr listen --json` prints them. A `baseline` given in the
/// file goes before the argument. A line that holds no report is passed over; a file of nothing but such lines is an
/// error.
core::Result<ReportLog> read_reports(const std::filesystem::path& file, etcs::Baseline baseline);

}  // namespace railfix::compare
