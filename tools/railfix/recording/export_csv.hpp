// A recording as tables: one CSV file for each topic, one column for each member of its type.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "core/result.hpp"
#include "mcap/reader.hpp"

namespace railfix::tool {

struct CsvReport {
  uint64_t rows = 0;
  size_t tables = 0;
  std::vector<std::string> problems;  // a sentence each
};

/// Writes TOPIC.csv (a slash becomes an underscore) into the folder: log_time_ns, publish_time_ns, sequence, then the
/// members as the recording's own IDL has them. Arrays are one cell, their elements with semicolons between them; long
/// octet arrays (pictures) are cut short; values that the IDL has names for are these names, bits with | between them;
/// unknown is an empty cell; text with a comma stands in double quotes (RFC
/// 4180). Error: no table is there; so, too, when `goes_on` says no.
core::Result<CsvReport> export_csv(mcap::Reader& reader, const mcap::Selection& part,
                                   const std::filesystem::path& folder, const mcap::GoesOn& goes_on = {});

}  // namespace railfix::tool
