// The reference implementation of MCAP (npm: @mcap/core) as a program; what it can do stands in
// tests/integration/mcap_reference/reference.mjs.
#pragma once

#include <cstdlib>
#include <filesystem>
#include <string>

namespace railfix::test {

class McapReference {
 public:
  /// Installed below `work` once.
  McapReference(const std::filesystem::path& source, std::filesystem::path work) : work_(std::move(work)) {
    if (std::system("npm --version > /dev/null 2>&1") != 0) {
      problem_ = "npm is not there";
      return;
    }
    namespace fs = std::filesystem;
    fs::create_directories(work_);
    for (const char* name : {"package.json", "reference.mjs"}) {
      fs::copy_file(source / name, work_ / name, fs::copy_options::overwrite_existing);
    }
    if (fs::exists(work_ / "node_modules" / "@mcap" / "support")) return;
    const std::string install = "cd '" + work_.string() + "' && npm install --no-audit --no-fund > npm.log 2>&1";
    if (std::system(install.c_str()) != 0) problem_ = "npm install failed, see " + (work_ / "npm.log").string();
  }

  /// Why it cannot be used; empty = it can.
  [[nodiscard]] const std::string& problem() const { return problem_; }
  [[nodiscard]] const std::filesystem::path& work() const { return work_; }
  /// False: it ended with an error, which errors.log in work() tells.
  [[nodiscard]] bool run(const std::string& action, const std::filesystem::path& argument,
                         const std::filesystem::path& out) const {
    const std::string command = "cd '" + work_.string() + "' && node reference.mjs " + action + " '" +
                                argument.string() + "' > '" + out.string() + "' 2> errors.log";
    return std::system(command.c_str()) == 0;
  }

 private:
  std::filesystem::path work_;
  std::string problem_;
};

}  // namespace railfix::test
