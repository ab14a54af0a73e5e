// Goes through every byte of a recording and holds it against the format: checksums, index, counts.
#pragma once

#include "mcap/reader.hpp"

namespace railfix::mcap {

/// Of one channel, in the order of the file.
struct ChannelContent {
  uint64_t messages = 0;
  uint64_t bytes = 0;  // of the messages' data
  int64_t first_ns = 0;
  int64_t last_ns = 0;
  int64_t longest_gap_ns = 0;
};

struct Check {
  std::map<uint16_t, ChannelContent> channels;
  uint64_t chunks = 0;
  uint64_t chunks_with_crc = 0;
  bool data_crc = false;              // the data section carries a checksum
  bool summary_crc = false;           // the index carries one
  std::vector<std::string> problems;  // a sentence each, with the byte; at most 100
};

/// Error: the file cannot be read at all. Everything else is a problem in the check.
core::Result<Check> check(const std::filesystem::path& file);

}  // namespace railfix::mcap
