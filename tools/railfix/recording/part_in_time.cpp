#include "recording/part_in_time.hpp"

#include <spdlog/fmt/fmt.h>

#include <cmath>

#include "core/time.hpp"

namespace railfix::tool {

core::Result<mcap::Selection> part_in_time(const mcap::Reader& reader, double from_s, double to_s) {
  const auto& statistics = reader.statistics();
  const double length_s = core::seconds(statistics.end_ns - statistics.start_ns);
  if (to_s <= from_s) return core::Error{fmt::format("--to {:g} must lie behind --from {:g}", to_s, from_s)};
  if (from_s > length_s) {
    const std::string end = std::isfinite(to_s) ? fmt::format("{:g} s", to_s) : "the end";
    return core::Error{fmt::format("there is nothing from {:g} s to {}: {} is {:.2f} s long", from_s, end,
                                   reader.file().string(), length_s)};
  }
  mcap::Selection part;
  part.from_ns = statistics.start_ns + core::to_ns(from_s);
  if (to_s <= length_s) part.to_ns = statistics.start_ns + core::to_ns(to_s);
  return part;
}

}  // namespace railfix::tool
