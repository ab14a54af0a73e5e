// Runs a program of this build as a user would, for tests.
#pragma once

#include <fcntl.h>
#include <poll.h>
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include <chrono>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <string>
#include <vector>

namespace railfix::test {

struct Outcome {
  int exit_code = -1;  // 128 + signal when it was ended by one, -1 when it ran too long
  std::string out;
  std::string err;
};

inline std::string slurp(const std::filesystem::path& file) {
  std::stringstream text;
  text << std::ifstream(file).rdbuf();
  return text.str();
}

/// `arguments[0]` is the program's name in the build's bin folder. Kills it after the patience.
inline Outcome run_program(const std::vector<std::string>& arguments, double patience_s) {
  const auto folder = std::filesystem::temp_directory_path() / ("railfix-program-" + std::to_string(getpid()));
  std::filesystem::create_directories(folder);
  const auto out = folder / "out";
  const auto err = folder / "err";
  const pid_t pid = fork();
  if (pid == 0) {
    dup2(open(out.c_str(), O_WRONLY | O_CREAT | O_TRUNC, 0644), STDOUT_FILENO);
    dup2(open(err.c_str(), O_WRONLY | O_CREAT | O_TRUNC, 0644), STDERR_FILENO);
    const std::string program = std::string(RAILFIX_BIN_DIR) + "/" + arguments[0];
    std::vector<char*> argv{const_cast<char*>(program.c_str())};
    for (size_t i = 1; i < arguments.size(); ++i) argv.push_back(const_cast<char*>(arguments[i].c_str()));
    argv.push_back(nullptr);
    execv(program.c_str(), argv.data());
    _exit(127);
  }
  Outcome outcome;
  const auto deadline = std::chrono::steady_clock::now() + std::chrono::duration<double>(patience_s);
  int wait_status = 0;
  bool ended = false;
  while (!ended && std::chrono::steady_clock::now() < deadline) {
    ended = waitpid(pid, &wait_status, WNOHANG) == pid;
    if (!ended) poll(nullptr, 0, 10);
  }
  if (!ended) {
    kill(pid, SIGKILL);
    waitpid(pid, &wait_status, 0);
  } else {
    outcome.exit_code = WIFSIGNALED(wait_status) ? 128 + WTERMSIG(wait_status) : WEXITSTATUS(wait_status);
  }
  outcome.out = slurp(out);
  outcome.err = slurp(err);
  std::filesystem::remove_all(folder);
  return outcome;
}

}  // namespace railfix::test
