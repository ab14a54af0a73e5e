// Position reports that the ground does not have yet, in one SQLite file (write-ahead log, synchronous FULL): what
// append() gave a number survives a power cut.
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "core/result.hpp"

namespace railfix::tpr_publisher {

class ReportStore {
 public:
  /// Makes the file when it is missing. One that can be read and is damaged is moved aside (FILE.damaged, or
  /// FILE.damaged-2, -3, ... beside those of before) and a new one begun.
  static core::Result<ReportStore> open(const std::filesystem::path& file);

  /// Empty, or that a damaged file was moved aside.
  [[nodiscard]] const std::string& problem() const { return problem_; }
  /// Files that were moved aside before and lie there still; empty = none.
  [[nodiscard]] const std::string& remark() const { return remark_; }
  /// Random, for the life of the file: of reports that an earlier version stored, without a stream and number of
  /// theirs.
  [[nodiscard]] uint64_t stream() const { return stream_; }
  /// One that nobody else has.
  static uint64_t new_stream();

  /// Numbers 1, 2, 3, ... never come twice, also when reports were removed. On the disk when it returns.
  core::Result<uint64_t> append(std::span<const uint8_t> report);
  core::Status remove(std::span<const uint64_t> sequences);
  /// In order.
  [[nodiscard]] core::Result<std::vector<uint64_t>> sequences() const;
  /// Nothing when its checksum is wrong or it is gone: it will never be read. After an error it may be, later.
  [[nodiscard]] core::Result<std::optional<std::vector<uint8_t>>> read(uint64_t sequence) const;

 private:
  struct Database;
  ReportStore() = default;
  core::Status begin(const std::filesystem::path& file);
  [[nodiscard]] std::string counted() const;
  std::shared_ptr<Database> database_;
  std::string problem_;
  std::string remark_;
  uint64_t stream_ = 0;
};

}  // namespace railfix::tpr_publisher
