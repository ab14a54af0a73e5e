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
#include <optional>
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

/// The command line of a service with `section.key=value` settings.
inline std::vector<std::string> with_settings(const std::string& program, const std::vector<std::string>& settings) {
  std::vector<std::string> arguments{program};
  for (const auto& setting : settings) arguments.insert(arguments.end(), {"--set", setting});
  return arguments;
}

/// A program of this build that runs beside the test. It is killed where its scope ends.
class Program {
 public:
  struct Options {
    std::filesystem::path out;     // empty: where the test's own output goes
    std::filesystem::path err;     // empty: where `out` goes
    std::filesystem::path folder;  // to run in
  };
  /// `arguments[0]` is the program's name in the build's bin folder, or an absolute path.
  explicit Program(std::vector<std::string> arguments) : Program(std::move(arguments), Options{}) {}
  Program(std::vector<std::string> arguments, const Options& options) {
    arguments[0] = (std::filesystem::path(RAILFIX_BIN_DIR) / arguments[0]).string();
    std::vector<char*> argv;
    argv.reserve(arguments.size() + 1);
    for (auto& argument : arguments) argv.push_back(argument.data());
    argv.push_back(nullptr);
    const int out = opened(options.out);
    const int err = opened(options.err);
    pid_ = fork();  // other threads may run here already: from now on nothing may allocate in the child
    if (pid_ == 0) {
      if (out >= 0) dup2(out, STDOUT_FILENO);
      if (err >= 0 || out >= 0) dup2(err >= 0 ? err : out, STDERR_FILENO);
      close_range(STDERR_FILENO + 1, ~0U, CLOSE_RANGE_CLOEXEC);  // DDS's sockets stay with the test
      if (options.folder.empty() || chdir(options.folder.c_str()) == 0) execv(argv[0], argv.data());
      _exit(127);
    }
    if (out >= 0) close(out);
    if (err >= 0) close(err);
  }
  ~Program() {
    if (!exit_code_) end(SIGKILL);
  }
  Program(const Program&) = delete;
  Program& operator=(const Program&) = delete;

  /// 128 + signal when it died of one; nothing while it runs.
  std::optional<int> exit_code() {
    if (!exit_code_) wait(WNOHANG);
    return exit_code_;
  }
  void send(int signal) {
    if (!exit_code()) kill(pid_, signal);
  }
  /// Sends the signal and waits for the end; gives the exit code.
  int end(int signal) {
    send(signal);
    return wait_for_end();
  }
  int wait_for_end() {
    if (!exit_code_) wait(0);
    return *exit_code_;
  }

 private:
  static int opened(const std::filesystem::path& file) {
    return file.empty() ? -1 : open(file.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0644);
  }
  void wait(int options) {
    int status = 0;
    if (waitpid(pid_, &status, options) == pid_)
      exit_code_ = WIFSIGNALED(status) ? 128 + WTERMSIG(status) : WEXITSTATUS(status);
  }
  pid_t pid_ = 0;
  std::optional<int> exit_code_;
};

/// Runs a program to its end, or kills it after the patience.
inline Outcome run_program(const std::vector<std::string>& arguments, double patience_s) {
  const auto folder = std::filesystem::temp_directory_path() / ("railfix-program-" + std::to_string(getpid()));
  std::filesystem::create_directories(folder);
  Outcome outcome;
  {
    Program program(arguments, {folder / "out", folder / "err", {}});
    const auto deadline = std::chrono::steady_clock::now() + std::chrono::duration<double>(patience_s);
    while (!program.exit_code() && std::chrono::steady_clock::now() < deadline) poll(nullptr, 0, 10);
    outcome.exit_code = program.exit_code().value_or(-1);
  }
  outcome.out = slurp(folder / "out");
  outcome.err = slurp(folder / "err");
  std::filesystem::remove_all(folder);
  return outcome;
}

}  // namespace railfix::test
