#include "train/left_behind.hpp"

#include <algorithm>
#include <fstream>
#include <set>
#include <string>

namespace railfix::tool {
namespace {

namespace fs = std::filesystem;

constexpr const char* kName = "fast_datasharing_";

bool is_process(const fs::path& entry) {
  const std::string name = entry.filename();
  return std::all_of(name.begin(), name.end(), [](char c) { return c >= '0' && c <= '9'; });
}

/// Names of data sharing's files that somebody has mapped; false when that cannot be known.
bool find_mapped(std::set<std::string>& names) {
  std::error_code none;
  for (const auto& entry : fs::directory_iterator("/proc", none)) {
    if (!is_process(entry.path())) continue;
    std::ifstream maps(entry.path() / "maps");
    if (!maps && fs::exists(entry.path(), none)) return false;
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
