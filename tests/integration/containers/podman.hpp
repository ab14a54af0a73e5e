// Podman for tests, where it works.
#pragma once

#include "support/program.hpp"

namespace railfix::test {

inline Outcome shell(const std::string& commands) {
  return run_program({"/bin/bash", "-c", commands}, 600);
}

/// Debian's mirror cannot be reached while an image is built.
inline bool is_no_network(const Outcome& built) {
  const std::string said = built.out + built.err;
  return built.exit_code != 0 &&
         (said.find("Failed to fetch") != std::string::npos || said.find("Unable to fetch") != std::string::npos);
}

/// Empty when it can run containers.
inline std::string why_no_podman() {
  constexpr const char* kEngineConf = "/etc/containers/railfix-containers.conf";
  if (std::filesystem::exists(kEngineConf)) setenv("CONTAINERS_CONF", kEngineConf, 0);
  const std::string base = "docker.io/library/debian:bookworm-slim";
  if (geteuid() != 0) return "containers of a train need root";
  if (shell("podman image inspect " + base).exit_code != 0)
    return "podman with the image " + base + " is not here; ../shared/container-engine/setup makes both";
  const auto trial = shell("podman run --rm --init " + base + " true");
  return trial.exit_code == 0 ? "" : "podman cannot run containers here: " + trial.err;
}

/// Asks a monitor for its page, as a browser does; for a shell.
inline std::string ask_for_page(const std::string& address) {
  return "bash -c 'exec 3<>/dev/tcp/" + address +
         "/8080; printf \"GET / HTTP/1.0\\r\\nHost: train\\r\\n\\r\\n\" >&3; cat <&3'";
}
/// In its answer: what Vite has built, and not the sentence of a monitor without a page.
inline constexpr const char* kBuiltPage = "src=\"./assets/";

}  // namespace railfix::test
