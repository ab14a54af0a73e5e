// Draws what the track detector saw on the pictures of a run, from its recording.
#pragma once

#include <filesystem>
#include <string>

#include "run/run_plan.hpp"

namespace railfix::tool {

/// One annotated picture per source picture in `folder`; returns a sentence on how many show both rails.
std::string draw_run(const RunOptions& options, const std::filesystem::path& recording,
                     const std::filesystem::path& folder);

}  // namespace railfix::tool
