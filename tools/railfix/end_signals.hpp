// By which a user or a system ends a command.
#pragma once

#include <array>
#include <csignal>

namespace railfix::tool {

inline constexpr std::array kEndSignals{SIGINT, SIGTERM, SIGHUP};

/// Signals that somebody ignores for us (nohup) stay ignored.
inline void on_end(void (*handler)(int)) {
  for (const int signal : kEndSignals) {
    if (std::signal(signal, handler) == SIG_IGN) std::signal(signal, SIG_IGN);
  }
}

}  // namespace railfix::tool
