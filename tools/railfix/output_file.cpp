#include "output_file.hpp"

#include <sys/stat.h>
#include <sys/sysmacros.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cstdio>

#include "core/result.hpp"

namespace railfix::tool {
namespace {

namespace fs = std::filesystem;

/// What datasets and runs are made of; figures, reports and drawings may be written beside it again and again.
bool is_data(const fs::path& file) {
  static constexpr std::array kEndings{".csv", ".jsonl", ".yaml", ".mcap", ".log", ".png", ".jpg", ".jpeg", ".pgm"};
  return std::ranges::find(kEndings, file.extension()) != kEndings.end();
}

bool lies_in(const fs::path& file, const fs::path& folder) {
  std::error_code failed;
  const auto from_there = fs::canonical(file, failed).lexically_relative(fs::canonical(folder, failed));
  return !failed && !from_there.empty() && *from_there.begin() != "..";
}

bool is_same(const struct stat& one, const struct stat& other) {
  return one.st_dev == other.st_dev && one.st_ino == other.st_ino;
}

bool takes_all(const struct stat& file) {
  constexpr unsigned kMemory = 1;
  constexpr unsigned kNull = 3;
  return S_ISCHR(file.st_mode) && file.st_rdev == makedev(kMemory, kNull);
}

/// Also where neither is there yet.
bool is_same(const fs::path& a, const fs::path& b) {
  struct stat one {};
  struct stat other {};
  if (stat(a.c_str(), &one) == 0 && stat(b.c_str(), &other) == 0) return is_same(one, other) && !takes_all(one);
  std::error_code failed;
  const auto place = fs::weakly_canonical(fs::absolute(a), failed);
  return !failed && place == fs::weakly_canonical(fs::absolute(b), failed);
}

}  // namespace

bool is_standard_output(const fs::path& file) {
  struct stat one {};
  struct stat other {};
  return stat(file.c_str(), &one) == 0 && fstat(STDOUT_FILENO, &other) == 0 && is_same(one, other) && !takes_all(one);
}

void check_output(const std::string& option, const fs::path& out, const std::vector<fs::path>& inputs) {
  if (out.empty()) return;
  const std::string what = option + " " + out.string();
  const auto folder = out.has_parent_path() ? out.parent_path() : fs::path(".");
  std::error_code failed;
  if (!fs::is_directory(folder, failed))
    throw core::BadInput(what + ": there is no folder " + folder.string() + "; make it first");
  if (fs::is_directory(out, failed)) throw core::BadInput(what + " is a folder; give the name of a file");
  if (!fs::exists(out, failed)) return;
  for (const auto& input : inputs) {
    if (fs::equivalent(out, input, failed))
      throw core::BadInput(what + " is " + input.string() + " itself, which is read; give another name");
    if (is_data(out) && fs::is_directory(input, failed) && lies_in(out, input))
      throw core::BadInput(what + " belongs to " + input.string() + ", which is read; give another name");
  }
}

void check_different(const std::vector<Output>& outputs) {
  for (auto second = outputs.begin(); second != outputs.end(); ++second) {
    for (auto first = outputs.begin(); first != second; ++first) {
      if (!first->file.empty() && !second->file.empty() && is_same(first->file, second->file))
        throw core::BadInput(first->option + " and " + second->option + " are both " + second->file.string() +
                             "; give each a file of its own");
    }
  }
}

void say_beside(const std::vector<fs::path>& outputs) {
  if (std::ranges::none_of(outputs, is_standard_output)) return;
  std::fflush(stdout);
  // Where standard error is closed nobody hears it.
  if (dup2(STDERR_FILENO, STDOUT_FILENO) < 0 && std::freopen("/dev/null", "w", stdout) == nullptr) std::fclose(stdout);
}

}  // namespace railfix::tool
