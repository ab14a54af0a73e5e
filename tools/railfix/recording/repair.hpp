// A proper recording of everything that can still be read of a damaged one.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "core/result.hpp"
#include "mcap/losses.hpp"

namespace railfix::tool {

struct RepairReport {
  uint64_t samples = 0;
  size_t topics = 0;
  mcap::Losses lost;
  std::vector<std::string> problems;  // a sentence each
};

/// The damaged one is left as it is; one without a readable sample is an error. The new file says in its metadata
/// (railfix_repair) what of it is missing.
core::Result<RepairReport> repair_recording(const std::filesystem::path& damaged, const std::filesystem::path& out);

}  // namespace railfix::tool
