// A table read row by row with its columns looked up by name: the first problem is kept and ends the reading, so that a
// reader is a plain list of its columns.
//
//   CsvTable table(file);
//   const size_t stamp = table.required({"stamp_ns"});
//   while (table.next()) rows.push_back({table.integer(stamp)});
//   if (!table.status().ok()) return table.status().error();
#pragma once

#include <optional>
#include <string>

#include "core/csv.hpp"

namespace railfix::core {

class CsvTable {
 public:
  using Names = std::initializer_list<std::string_view>;

  explicit CsvTable(const std::filesystem::path& file);

  /// Column with the first of these names; without one the table holds no rows and status() says so.
  [[nodiscard]] size_t required(Names names);
  [[nodiscard]] std::optional<size_t> optional(Names names) const;

  bool next();
  /// As next(), and refuses a stamp that is before the one of the row above.
  bool next(size_t stamp_column);
  [[nodiscard]] int64_t stamp_ns() const { return stamp_ns_; }

  int64_t integer(size_t column);
  /// NaN where there is no such column or nothing in it; beyond +-`most` is a problem.
  double number_or_nan(std::optional<size_t> column, double most = CsvReader::kUnlimited);
  /// An empty cell, NaN or infinity is a problem, and what is beyond +-`most`.
  double finite(size_t column, double most = CsvReader::kUnlimited);
  [[nodiscard]] std::string text(size_t column) const { return std::string(reader_->text(column)); }
  /// This row is wrong for a reason of the caller's.
  void refuse(const std::string& what);
  /// ... or this cell of it: "'TEXT' in column NAME " and what.
  void refuse_cell(size_t column, const std::string& what);

  [[nodiscard]] Status status() const;

 private:
  template <class T>
  T keep(const Result<T>& value);

  std::filesystem::path file_;
  std::optional<CsvReader> reader_;
  Status status_;
  int64_t stamp_ns_ = 0;
  std::optional<int64_t> last_stamp_ns_;
};

}  // namespace railfix::core
