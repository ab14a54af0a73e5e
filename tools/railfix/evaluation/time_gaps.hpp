// Where a table has no rows though it usually has.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

namespace railfix::evaluation {

struct TimeGaps {
  size_t count = 0;
  double longest_s = 0;
  int64_t longest_from_ns = 0;
};

/// Rows further apart than this have a gap between them: a second, and three times as far as usual.
int64_t longest_step_ns(const std::vector<int64_t>& stamps_ns);
/// REQUIRES: stamps in their order.
TimeGaps gaps_in(const std::vector<int64_t>& stamps_ns);

template <class Row>
std::vector<int64_t> stamps_of(const std::vector<Row>& rows) {
  std::vector<int64_t> stamps_ns;
  stamps_ns.reserve(rows.size());
  for (const Row& row : rows) stamps_ns.push_back(row.stamp_ns);
  return stamps_ns;
}

}  // namespace railfix::evaluation
