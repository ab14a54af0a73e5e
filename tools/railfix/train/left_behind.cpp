#include "train/left_behind.hpp"

#include <algorithm>
#include <fstream>
#include <set>
#include <string>

#include "train/stands_still.hpp"

namespace railfix::tool {
namespace {

namespace fs = std::filesystem;

constexpr const char* kName = "fast_datasharing_";

/// Names of data sharing's files that somebody has mapped; false when that cannot be known.
bool find_mapped(std::set<std::string>& names) {
  for (const pid_t pid : processes()) {
    const fs::path process = "/proc/" + std::to_string(pid);
    std::ifstream maps(process / "maps");
    std::error_code none;
    if (!maps && fs::exists(process, none)) return false;
    for (std::string line; std::getline(maps, line);) {
      const size_t at = line.find(kName);
      if (at != std::string::npos) names.insert(line.substr(at, line.find(' ', at) - at));
    }
  }
  return true;
}

}  // namespace

std::vector<fs::path> left_behind(const fs::path& folder) {
  std::vector<fs::path> files;
  std::error_code none;
  for (const auto& entry : fs::directory_iterator(folder, none)) {
    if (entry.path().filename().string().starts_with(kName)) files.push_back(entry.path());
  }
  if (files.empty()) return {};
  std::set<std::string> mapped;
  if (!find_mapped(mapped)) return {};
  std::erase_if(files, [&](const fs::path& file) { return mapped.contains(file.filename()); });
  std::sort(files.begin(), files.end());
  return files;
}

void remove_left_behind(const std::vector<fs::path>& before, const fs::path& folder) {
  std::error_code none;
  for (const auto& file : left_behind(folder)) {
    if (std::binary_search(before.begin(), before.end(), file)) fs::remove(file, none);
  }
}

}  // namespace railfix::tool
