#include "late_end.hpp"

#include "end_signals.hpp"

namespace railfix::tool {
namespace {

volatile std::sig_atomic_t asked_by = 0;

void note(int signal) {
  asked_by = signal;
  on_end(SIG_DFL);
}

}  // namespace

LateEnd::LateEnd() {
  asked_by = 0;
  on_end(note);
}

LateEnd::~LateEnd() {
  if (asked()) std::raise(asked_by);
  on_end(SIG_DFL);
}

bool LateEnd::asked() {
  return asked_by != 0;
}

}  // namespace railfix::tool
