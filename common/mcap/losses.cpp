#include "mcap/losses.hpp"

#include <algorithm>

namespace railfix::mcap {

Losses losses_of(const Reader& damaged, uint64_t messages) {
  Losses losses;
  losses.chunks = damaged.lost_chunks().size();
  losses.bytes = damaged.unread_bytes();
  for (const auto& [place, bytes] : damaged.lost_chunks()) losses.bytes += bytes;
  const uint64_t counted = damaged.statistics().messages;
  const bool whole = damaged.closed() && losses.bytes == 0;  // by an index or without one
  if (damaged.indexed() || whole) losses.samples = counted - std::min(counted, messages);
  return losses;
}

std::string told(const Losses& losses) {
  const auto counted = [](uint64_t count, const std::string& what) {
    return std::to_string(count) + " " + what + (count == 1 ? "" : "s");
  };
  const auto samples = losses.samples ? counted(*losses.samples, "sample") : "nobody knows how many samples";
  return samples + ", " + counted(losses.chunks, "chunk") + ", " + counted(losses.bytes, "byte") +
         " that cannot be read";
}

Metadata repair_trace(const Losses& losses, const std::filesystem::path& damaged) {
  Metadata trace{"railfix_repair",
                 {{"file", damaged.filename().string()},
                  {"lost_chunks", std::to_string(losses.chunks)},
                  {"skipped_bytes", std::to_string(losses.bytes)}}};
  if (losses.samples) trace.entries["lost_samples"] = std::to_string(*losses.samples);
  return trace;
}

}  // namespace railfix::mcap
