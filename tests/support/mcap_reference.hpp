// The reference implementation of MCAP (npm: @mcap/core) as a program; what it can do stands in
// tests/integration/mcap_reference/reference.mjs.
#pragma once

#include <cstdlib>
#include <filesystem>
#include <string>

#include "support/npm.hpp"

namespace railfix::test {

class McapReference {
 public:
  /// Installed below `work`.
  McapReference(const std::filesystem::path& source, std::filesystem::path work) : work_(std::move(work)) {
    problem_ = npm_is_there() ? install_script(source, "reference.mjs", work_) : "npm is not there";
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
