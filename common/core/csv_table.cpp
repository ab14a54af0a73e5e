#include "core/csv_table.hpp"

#include <cmath>
#include <limits>

namespace railfix::core {

CsvTable::CsvTable(const std::filesystem::path& file) : file_(file) {
  auto opened = CsvReader::open(file);
  if (opened.ok()) {
    reader_.emplace(std::move(opened).value());
  } else {
    status_ = opened.error();
  }
}

size_t CsvTable::required(Names names) {
  const auto found = optional(names);
  if (!found && status_.ok())
    status_ = Error{file_.string() + " line 1: has no column '" + std::string(*names.begin()) + "'"};
  return found.value_or(0);
}

std::optional<size_t> CsvTable::optional(Names names) const {
  return reader_ ? reader_->column(names) : std::nullopt;
}

bool CsvTable::next() {
  return status_.ok() && reader_->next();
}

bool CsvTable::next(size_t stamp_column) {
  if (!next()) return false;
  stamp_ns_ = integer(stamp_column);
  if (last_stamp_ns_ && stamp_ns_ < *last_stamp_ns_) refuse("has a timestamp before that of the row above");
  last_stamp_ns_ = stamp_ns_;
  return status_.ok();
}

template <class T>
T CsvTable::keep(const Result<T>& value) {
  if (value.ok()) return value.value();
  if (status_.ok()) status_ = value.error();
  return T{};
}

int64_t CsvTable::integer(size_t column) {
  return keep(reader_->integer(column));
}

double CsvTable::number_or_nan(std::optional<size_t> column, double most) {
  return column ? keep(reader_->number(*column, most)) : std::numeric_limits<double>::quiet_NaN();
}

double CsvTable::finite(size_t column, double most) {
  const double value = keep(reader_->number(column, most));
  if (!std::isfinite(value)) refuse("has no finite number in column " + reader_->header()[column]);
  return value;
}

void CsvTable::refuse(const std::string& what) {
  if (status_.ok()) status_ = reader_->error(what);
}

void CsvTable::refuse_cell(size_t column, const std::string& what) {
  refuse("'" + text(column) + "' in column " + reader_->header().at(column) + " " + what);
}

Status CsvTable::status() const {
  if (!status_.ok() || !reader_) return status_;
  return reader_->status();
}

}  // namespace railfix::core
