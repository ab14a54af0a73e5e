// The stamps of a run's table.
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "core/csv_table.hpp"

namespace railfix::tool {

/// The stamps of a table, in the order of its rows.
class Stamps {
 public:
  /// Of this row, which is refused where that lies far before the one of a row above.
  int64_t next(core::CsvTable& table, size_t column) {
    constexpr uint64_t kInterleavedNs = 1'000'000'000;  // several cameras, or a standby that takes over, write in turn
    const int64_t stamp_ns = table.integer(column);
    is_late_ = newest_ns_ && stamp_ns < *newest_ns_;
    if (is_late_ && static_cast<uint64_t>(*newest_ns_) - static_cast<uint64_t>(stamp_ns) > kInterleavedNs)
      table.refuse("the stamp " + std::to_string(stamp_ns) +
                   " goes back by more than 1 s; was the clock set, or are these two runs?");
    if (!is_late_) newest_ns_ = stamp_ns;
    return stamp_ns;
  }
  /// A row above is newer.
  [[nodiscard]] bool late() const { return is_late_; }

 private:
  std::optional<int64_t> newest_ns_;
  bool is_late_ = false;
};

}  // namespace railfix::tool
