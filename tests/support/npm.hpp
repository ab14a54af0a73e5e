// Programs of the tests in JavaScript, with packages from npm.
#pragma once

#include <cstdlib>
#include <filesystem>
#include <string>

namespace railfix::test {

[[nodiscard]] inline bool npm_is_there() {
  return std::system("npm --version > /dev/null 2>&1") == 0;
}

/// `script` and its package.json go from `source` to `work`, with what package.json names beside them (what an earlier
/// build left there may be older than package.json). What went wrong; empty = nothing.
[[nodiscard]] inline std::string install_script(const std::filesystem::path& source, const char* script,
                                                const std::filesystem::path& work) {
  namespace fs = std::filesystem;
  fs::create_directories(work);
  for (const char* name : {"package.json", script})
    fs::copy_file(source / name, work / name, fs::copy_options::overwrite_existing);
  const std::string install = "cd '" + work.string() + "' && npm install --no-audit --no-fund > npm.log 2>&1";
  return std::system(install.c_str()) == 0 ? "" : "npm install failed, see " + (work / "npm.log").string();
}

}  // namespace railfix::test
