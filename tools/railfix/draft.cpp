#include "draft.hpp"

#include <unistd.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <climits>

#include "core/whole_file.hpp"
#include "end_signals.hpp"

namespace railfix::tool {

namespace {

// For the handler, which may come in any thread and must not meet a text that is just being freed.
std::array<char, PATH_MAX> living_name{};
std::atomic<bool> lives{false};
static_assert(std::atomic<bool>::is_always_lock_free);

/// Ends the program as the signal does without us.
void remove_and_end(int signal) {
  if (lives) unlink(living_name.data());
  std::signal(signal, SIG_DFL);
  std::raise(signal);
}

}  // namespace

Draft::Draft(std::filesystem::path file) : file_(std::move(file)) {
  const auto& name = file_.native();
  if (name.size() >= living_name.size()) return;  // no system call takes it
  *std::ranges::copy(name, living_name.begin()).out = '\0';
  lives = true;
  on_end(remove_and_end);
}

core::Result<std::unique_ptr<Draft>> Draft::beside(const std::filesystem::path& file, const std::string& ending) {
  sigset_t ends;
  sigemptyset(&ends);
  for (const int signal : kEndSignals) sigaddset(&ends, signal);
  sigset_t before;
  pthread_sigmask(SIG_BLOCK, &ends, &before);
  const auto made = core::draft_beside(file, ending);
  auto draft = made.ok() ? std::make_unique<Draft>(made.value()) : nullptr;
  pthread_sigmask(SIG_SETMASK, &before, nullptr);
  if (!made.ok()) return made.error();
  return draft;
}

Draft::~Draft() {
  std::error_code failed;
  if (!kept_) std::filesystem::remove(file_, failed);
  lives = false;
}

void Draft::keep() {
  kept_ = true;
  lives = false;
}

}  // namespace railfix::tool
