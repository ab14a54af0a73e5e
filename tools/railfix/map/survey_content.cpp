#include "map/survey_content.hpp"

#include <algorithm>
#include <array>
#include <charconv>
#include <cinttypes>
#include <cmath>
#include <cstdio>
#include <ranges>

#include "core/fnv.hpp"
#include "core/whole_file.hpp"

namespace railfix::tool {
namespace {

constexpr size_t kKept = 32;
constexpr size_t kDigits = 8;        // of a number
constexpr size_t kTableDigits = 16;  // of a table

}  // namespace

RunContent::RunContent(const std::string& text) : table_(text.substr(0, kTableDigits)) {
  for (size_t i = kTableDigits; i + kDigits <= text.size(); i += kDigits) {
    uint32_t number = 0;
    std::from_chars(text.data() + i, text.data() + i + kDigits, number, 16);
    numbers_.insert(number);
  }
  if (numbers_.size() >= kKept) complete_to_ = *numbers_.rbegin();
}

core::Status RunContent::add_table(const std::filesystem::path& file) {
  constexpr std::string_view kByteOrderMark = "\xEF\xBB\xBF";
  auto read = core::read_whole(file);
  if (!read.ok()) return read.error();
  std::string text = std::move(read).value();
  if (text.starts_with(kByteOrderMark)) text.erase(0, kByteOrderMark.size());
  std::erase(text, '\r');
  core::Fnv fnv;
  fnv.add(text);
  table_ = fnv.hex();
  return {};
}

void RunContent::add(int64_t stamp_ns, track::LandmarkKind kind, double ahead_m) {
  constexpr double kMmPerM = 1000;
  core::Fnv fnv;
  fnv.add(std::to_string(stamp_ns) + "," + track::to_string(kind) + "," +
          std::to_string(std::llround(kMmPerM * ahead_m)));
  numbers_.insert(static_cast<uint32_t>(fnv.value() ^ (fnv.value() >> 32U)));
}

std::string RunContent::text() const {
  std::string out = table_;
  for (const uint32_t number : numbers_ | std::views::take(kKept)) {
    std::array<char, kDigits + 1> digits{};
    std::snprintf(digits.data(), digits.size(), "%08" PRIx32, number);
    out += digits.data();
  }
  return out;
}

bool RunContent::same_run(const RunContent& other) const {
  if (table_ == other.table_) return true;
  const uint32_t to = std::min(complete_to_, other.complete_to_);
  const auto within = [to](const std::set<uint32_t>& numbers) {
    return std::vector<uint32_t>(numbers.begin(), numbers.upper_bound(to));
  };
  const auto mine = within(numbers_);
  const auto others = within(other.numbers_);
  std::vector<uint32_t> both;
  std::ranges::set_intersection(mine, others, std::back_inserter(both));
  return !both.empty() && 2 * both.size() >= std::min(mine.size(), others.size());
}

}  // namespace railfix::tool
