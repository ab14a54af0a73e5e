// Which runs are one: by what they saw, and when.
#pragma once

#include <cstdint>
#include <filesystem>
#include <set>
#include <string>

#include "core/result.hpp"
#include "track/map.hpp"

namespace railfix::tool {

/// The table of sightings as a whole, and its rows as numbers, one each of stamp, kind and distance to 1 mm. A part of
/// a run has a part of them; another ride, also one at the same stamps (simulations), has next to none.
class RunContent {
 public:
  RunContent() = default;
  /// One of Map::learnt_runs; maps of earlier releases have the table alone.
  explicit RunContent(const std::string& text);
  /// The table itself, whatever its line ends.
  core::Status add_table(const std::filesystem::path& file);
  void add(int64_t stamp_ns, track::LandmarkKind kind, double ahead_m);

  /// For Map::learnt_runs: of the numbers the smallest, which are as good as drawn by lot, and the same lot for a part
  /// of a run.
  [[nodiscard]] std::string text() const;
  /// One is the other, or a part of it.
  [[nodiscard]] bool same_run(const RunContent& other) const;

 private:
  std::string table_;
  std::set<uint32_t> numbers_;
  uint32_t complete_to_ = UINT32_MAX;
};

}  // namespace railfix::tool
