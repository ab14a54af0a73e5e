// What of a damaged recording could not be read, and how the one that was made of it says so for ever.
#pragma once

#include <optional>

#include "mcap/reader.hpp"

namespace railfix::mcap {

struct Losses {
  size_t chunks = 0;
  uint64_t bytes = 0;               // those of the lost chunks, too
  std::optional<uint64_t> samples;  // nothing: the index that counted them is gone
};

/// REQUIRES: all messages have been read, and so many came.
Losses losses_of(const Reader& damaged, uint64_t messages);

/// "3 samples, 1 chunk, 700 bytes that cannot be read".
std::string told(const Losses& losses);

/// The metadata record `railfix_repair`.
Metadata repair_trace(const Losses& losses, const std::filesystem::path& damaged);

}  // namespace railfix::mcap
