// Tables as the dataset and run formats have them: a header row, commas, numbers or words. Every error names file and
// line.
#pragma once

#include <cstdint>
#include <filesystem>
#include <fstream>
#include <limits>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "core/result.hpp"

namespace railfix::core {

/// Reads row by row; a large file is never in memory as a whole.
class CsvReader {
 public:
  /// Opens the file and reads its header (a leading '#', spaces and units in [brackets] are dropped from the names,
  /// inner spaces become '_').
  static Result<CsvReader> open(const std::filesystem::path& file);

  [[nodiscard]] const std::vector<std::string>& header() const { return header_; }
  /// Index of the first of these names in the header.
  [[nodiscard]] std::optional<size_t> column(std::initializer_list<std::string_view> names) const;

  /// Next row, skipping empty lines and lines that begin with '#'. False at the end of the file or at an error: see
  /// status().
  bool next();
  [[nodiscard]] const Status& status() const { return status_; }
  /// Forgets a row that has too few or too many values, so that next() goes on behind it. False: the file cannot be
  /// read further.
  bool pass_over();

  [[nodiscard]] size_t cells() const { return cells_.size(); }
  [[nodiscard]] std::string_view text(size_t column) const { return cells_.at(column); }
  [[nodiscard]] Result<int64_t> integer(size_t column) const;
  /// An empty cell is NaN; a number beyond +-`most` is an error.
  [[nodiscard]] Result<double> number(size_t column, double most = kUnlimited) const;
  static constexpr double kUnlimited = std::numeric_limits<double>::infinity();
  /// "FILE line N: WHAT"
  [[nodiscard]] Error error(const std::string& what) const;

 private:
  CsvReader() = default;
  std::filesystem::path file_;
  std::ifstream stream_;
  std::vector<std::string> header_;
  std::string line_;
  std::vector<std::string_view> cells_;
  size_t line_number_ = 0;
  Status status_;
};

/// Writes one table; cells of a row one after the other, NaN and not-known as an empty cell.
class CsvWriter {
 public:
  /// REQUIRES: the folder exists. Throws BadInput when the file cannot be written.
  CsvWriter(const std::filesystem::path& file, const std::string& header);
  ~CsvWriter();
  CsvWriter(const CsvWriter&) = delete;
  CsvWriter& operator=(const CsvWriter&) = delete;

  CsvWriter& operator<<(int64_t value);
  CsvWriter& operator<<(uint64_t value);
  CsvWriter& operator<<(int value) { return *this << static_cast<int64_t>(value); }
  CsvWriter& operator<<(uint32_t value) { return *this << static_cast<uint64_t>(value); }
  CsvWriter& operator<<(double value);  // shortest text that reads back to the same number
  CsvWriter& operator<<(std::string_view value);
  CsvWriter& operator<<(const char* value) { return *this << std::string_view(value); }
  CsvWriter& empty();
  void end_row();
  /// False: something was lost already, as close() will say.
  [[nodiscard]] bool whole() const { return stream_.good(); }
  /// Flushes; an error (disk full) is a sentence.
  Status close();

 private:
  void separate();
  std::filesystem::path file_;
  std::ofstream stream_;
  bool row_begun_ = false;
};

}  // namespace railfix::core
