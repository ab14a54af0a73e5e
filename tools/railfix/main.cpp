#include <algorithm>
#include <cerrno>
#include <cstdio>
#include <exception>
#include <iostream>
#include <string>
#include <vector>

#include "commands.hpp"
#include "core/joined.hpp"
#include "core/result.hpp"
#include "core/similar_names.hpp"
#include "core/whole_file.hpp"

namespace {

constexpr int kWorkFailed = 1;
constexpr int kBadInput = 2;

/// What is wrong when a command is missing, for which CLI11 has no word of help; empty when it is something else.
std::string missing_command(const CLI::App& app) {
  const CLI::App* at = &app;
  std::string path = app.get_name();
  while (!at->get_subcommands().empty()) {
    at = at->get_subcommands().front();
    path += " " + at->get_name();
  }
  if (at->get_require_subcommand_min() == 0) return "";
  std::vector<std::string> names;
  for (const auto* one : at->get_subcommands([](const CLI::App*) { return true; })) names.push_back(one->get_name());
  const auto typed = at->remaining();
  const std::string wanted = typed.empty() ? "" : typed.front();
  if (typed.empty())
    return path + ": a command is missing; there are: " + railfix::core::joined(names) + "; " + path +
           " COMMAND --help explains each";
  return path + ": there is no command '" + wanted + "'; " + railfix::core::did_you_mean(wanted, names);
}

/// The same where help is asked for something that is no command, and would be given for the one above it.
std::string unknown_command(const CLI::App& app) {
  const CLI::App* at = &app;
  while (!at->get_subcommands().empty()) at = at->get_subcommands().front();
  const auto typed = at->remaining();
  return typed.empty() || typed.front().starts_with('-') ? "" : missing_command(app);
}

/// `railfix help tpr decode` is `railfix tpr decode --help`; a command that is not there is told as such.
std::vector<std::string> words_of(const CLI::App& app, int argc, char** argv) {
  std::vector<std::string> words(argv + 1, argv + argc);
  if (words.empty() || words.front() != "help") return words;
  words.erase(words.begin());
  const CLI::App* at = &app;
  for (const auto& word : words) {
    const auto named = at->get_subcommands([&](const CLI::App* one) { return one->get_name() == word; });
    if (named.empty()) return words;
    at = named.front();
  }
  words.emplace_back("--help");
  return words;
}

int run(int argc, char** argv) {
  using namespace railfix::tool;
  CLI::App app{
      "Railfix: where the train is, from a camera. `railfix COMMAND --help` explains a command with an example.",
      "railfix"};
  app.set_version_flag("--version", std::string("railfix ") + RAILFIX_VERSION);
  app.require_subcommand(1);
  Action chosen;
  for (const auto add : {add_run, add_simulate, add_evaluate, add_calibrate, add_map, add_top, add_topics, add_log,
                         add_replay, add_recording, add_tell, add_tpr, add_train, add_doctor}) {
    add(app, chosen);
  }
  try {
    auto words = words_of(app, argc, argv);
    std::ranges::reverse(words);  // CLI11 takes them from the end
    app.parse(words);
  } catch (const CLI::RequiredError& error) {
    const auto missing = missing_command(app);
    if (missing.empty()) return app.exit(error) == 0 ? 0 : kBadInput;
    std::cerr << missing << '\n';
    return kBadInput;
  } catch (const CLI::CallForHelp& help) {
    const auto unknown = unknown_command(app);
    if (unknown.empty()) return app.exit(help);
    std::cerr << unknown << '\n';
    return kBadInput;
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? 0 : kBadInput;
  }
  try {
    return chosen();
  } catch (const railfix::core::BadInput& error) {
    std::cerr << "railfix: " << error.what() << '\n';
    return kBadInput;
  } catch (const std::exception& error) {
    std::cerr << "railfix: the work failed: " << error.what() << '\n';
    return kWorkFailed;
  }
}

/// The exit code, and a sentence where standard output did not take everything: what is written there waits in buffers,
/// so that no command sees a full disk.
int with_all_told(int exit_code) {
  const bool lost = std::ferror(stdout) != 0;
  if (lost) std::putchar('\n');  // nobody kept the reason: the system gives it again to the next who writes
  errno = 0;
  if (std::fflush(stdout) == 0 && !lost) return exit_code;
  if (errno == EPIPE) return exit_code;  // who read has seen enough
  if (errno == 0) {
    std::cerr << "railfix: standard output did not take everything, what it holds is cut\n";  // there is room again
  } else {
    std::cerr << "railfix: " << railfix::core::cannot_write("to standard output").message << '\n';
  }
  return exit_code == 0 ? kWorkFailed : exit_code;
}

}  // namespace

int main(int argc, char** argv) {
  return with_all_told(run(argc, argv));
}
