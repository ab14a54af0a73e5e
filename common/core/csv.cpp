#include "core/csv.hpp"

#include <algorithm>
#include <array>
#include <cerrno>
#include <charconv>
#include <cmath>
#include <cstdio>

#include "core/whole_file.hpp"

namespace railfix::core {
namespace {

std::string_view trim(std::string_view text) {
  const auto is_space = [](char c) { return c == ' ' || c == '\t' || c == '\r'; };
  while (!text.empty() && is_space(text.front())) text.remove_prefix(1);
  while (!text.empty() && is_space(text.back())) text.remove_suffix(1);
  return text;
}

void split(std::string_view line, std::vector<std::string_view>& cells) {
  cells.clear();
  size_t begin = 0;
  while (true) {
    const size_t comma = line.find(',', begin);
    cells.push_back(trim(line.substr(begin, comma == std::string_view::npos ? comma : comma - begin)));
    if (comma == std::string_view::npos) return;
    begin = comma + 1;
  }
}

std::string column_name(std::string_view cell) {
  if (!cell.empty() && cell.front() == '#') cell.remove_prefix(1);
  cell = trim(cell.substr(0, cell.find('[')));
  std::string name(cell);
  for (char& c : name) {
    if (c == ' ') c = '_';
  }
  return name;
}

}  // namespace

Result<CsvReader> CsvReader::open(const std::filesystem::path& file) {
  std::error_code unreadable;  // told below
  if (std::filesystem::is_directory(file, unreadable)) return Error{file.string() + " is a folder, not a file"};
  if (std::filesystem::is_regular_file(file.parent_path(), unreadable))
    return Error{file.parent_path().string() + " is a file; give the folder that holds " + file.filename().string()};
  CsvReader reader;
  reader.file_ = file;
  reader.stream_.open(file);
  if (!reader.stream_) return Error{file.string() + " cannot be opened; check that the file exists and may be read"};
  if (!std::getline(reader.stream_, reader.line_)) {
    if (reader.stream_.bad()) return cannot_read(file.string());
    return Error{file.string() + " is empty; the first line must name the columns"};
  }
  reader.line_number_ = 1;
  std::string_view first = reader.line_;
  if (first.starts_with("\xEF\xBB\xBF")) first.remove_prefix(3);
  split(first, reader.cells_);
  for (const auto cell : reader.cells_) reader.header_.push_back(column_name(cell));
  reader.cells_.clear();
  return reader;
}

std::optional<size_t> CsvReader::column(std::initializer_list<std::string_view> names) const {
  for (const auto name : names) {
    for (size_t i = 0; i < header_.size(); ++i) {
      if (header_[i] == name) return i;
    }
  }
  return std::nullopt;
}

bool CsvReader::next() {
  while (std::getline(stream_, line_)) {
    ++line_number_;
    const std::string_view content = trim(line_);
    if (content.empty() || content.front() == '#') continue;
    split(content, cells_);
    const auto named = static_cast<std::ptrdiff_t>(std::min(header_.size(), cells_.size()));
    const bool too_many =
        std::any_of(cells_.begin() + named, cells_.end(), [](std::string_view cell) { return !cell.empty(); });
    if (cells_.size() >= header_.size() && !too_many) return true;
    status_ = error("has " + std::to_string(cells_.size()) + " values where the header names " +
                    std::to_string(header_.size()) + " columns" +
                    (too_many ? "; is a comma used as the decimal point?" : ""));
    return false;
  }
  if (stream_.bad()) status_ = error("cannot be read further");
  return false;
}

bool CsvReader::pass_over() {
  if (stream_.bad()) return false;
  status_ = {};
  return true;
}

Result<int64_t> CsvReader::integer(size_t column) const {
  const std::string_view cell = cells_.at(column);
  int64_t value = 0;
  const auto [end, code] = std::from_chars(cell.data(), cell.data() + cell.size(), value);
  if (code != std::errc{} || end != cell.data() + cell.size()) {
    return error("'" + std::string(cell) + "' in column " + header_.at(column) + " is not a whole number");
  }
  return value;
}

Result<double> CsvReader::number(size_t column, double most) const {
  const std::string_view cell = cells_.at(column);
  if (cell.empty()) return std::nan("");
  double value = 0;
  const auto [end, code] = std::from_chars(cell.data(), cell.data() + cell.size(), value);
  if (code != std::errc{} || end != cell.data() + cell.size()) {
    return error("'" + std::string(cell) + "' in column " + header_.at(column) + " is not a number");
  }
  if (std::abs(value) > most) {
    std::array<char, 32> limit{};
    std::snprintf(limit.data(), limit.size(), "%g", most);
    return error("'" + std::string(cell) + "' in column " + header_.at(column) + " is beyond " + limit.data() +
                 ", the most that it can be; correct the cell");
  }
  return value;
}

Error CsvReader::error(const std::string& what) const {
  return Error{file_.string() + " line " + std::to_string(line_number_) + ": " + what};
}

CsvWriter::CsvWriter(const std::filesystem::path& file, const std::string& header) : file_(file), stream_(file) {
  if (!stream_) throw BadInput(cannot_write(file.string()));
  stream_ << header << '\n';
}

CsvWriter::~CsvWriter() = default;

void CsvWriter::separate() {
  if (row_begun_) stream_ << ',';
  row_begun_ = true;
}

CsvWriter& CsvWriter::operator<<(int64_t value) {
  separate();
  stream_ << value;
  return *this;
}

CsvWriter& CsvWriter::operator<<(uint64_t value) {
  separate();
  stream_ << value;
  return *this;
}

CsvWriter& CsvWriter::operator<<(double value) {
  separate();
  if (!std::isfinite(value)) return *this;
  char buffer[32];
  const auto [end, code] = std::to_chars(buffer, buffer + sizeof buffer, value);
  if (code == std::errc{}) stream_.write(buffer, end - buffer);
  return *this;
}

CsvWriter& CsvWriter::operator<<(std::string_view value) {
  separate();
  stream_ << value;
  return *this;
}

CsvWriter& CsvWriter::empty() {
  separate();
  return *this;
}

void CsvWriter::end_row() {
  stream_ << '\n';
  row_begun_ = false;
}

Status CsvWriter::close() {
  errno = 0;
  stream_.close();  // tries once more where writing failed, and so gives the reason, unless there is room again
  if (stream_) return {};
  if (errno == 0) errno = EIO;
  return cannot_write(file_.string() + " to its end");
}

}  // namespace railfix::core
