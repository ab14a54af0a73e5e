#include "train/run.hpp"

#include <sys/wait.h>

#include <array>
#include <cstdio>

namespace railfix::tool {

Ran run(const std::vector<std::string>& command) {
  std::string line;
  for (const auto& word : command) line += "'" + word + "' ";
  Ran ran;
  FILE* pipe = popen((line + "2>&1 </dev/null").c_str(), "r");
  if (pipe == nullptr) return ran;
  std::array<char, 512> part{};
  while (std::fgets(part.data(), part.size(), pipe) != nullptr) ran.text += part.data();
  while (!ran.text.empty() && ran.text.back() == '\n') ran.text.pop_back();
  const int status = pclose(pipe);
  if (WIFEXITED(status)) ran.exit_code = WEXITSTATUS(status);
  return ran;
}

}  // namespace railfix::tool
