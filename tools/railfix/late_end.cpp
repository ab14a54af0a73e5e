#include "late_end.hpp"

#include <array>
#include <csignal>

namespace railfix::tool {
namespace {

constexpr std::array kEnds{SIGINT, SIGTERM, SIGHUP};

volatile std::sig_atomic_t asked_by = 0;

void note(int signal) {
  asked_by = signal;
  for (const int end : kEnds) std::signal(end, SIG_DFL);
}

}  // namespace

LateEnd::LateEnd() {
  asked_by = 0;
  // Signals that somebody ignores for us (nohup) stay ignored.
  for (const int end : kEnds) {
    if (std::signal(end, note) == SIG_IGN) std::signal(end, SIG_IGN);
  }
}

LateEnd::~LateEnd() {
  if (asked()) std::raise(asked_by);
  for (const int end : kEnds) {
    if (std::signal(end, SIG_DFL) == SIG_IGN) std::signal(end, SIG_IGN);
  }
}

bool LateEnd::asked() {
  return asked_by != 0;
}

}  // namespace railfix::tool
