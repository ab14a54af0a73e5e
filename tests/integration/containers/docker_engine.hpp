// Docker's own engine, as it would run on a host of its own: started by the test in the network of the caller.
#pragma once

#include <sys/mount.h>

#include "images.hpp"

namespace railfix::test {

class DockerEngine {
 public:
  /// Everything that it keeps lies below `folder`, and goes with it. It leaves the host's network alone, as containers
  /// of a train use the host's own.
  explicit DockerEngine(const std::filesystem::path& folder)
      : folder_(folder),
        address_("unix://" + (folder / "socket").string()),
        engine_({"/usr/bin/env", "dockerd", "--iptables=false", "--ip6tables=false", "--bridge=none",
                 "--data-root=" + (folder / "data").string(), "--exec-root=" + (folder / "exec").string(),
                 "--pidfile=" + (folder / "pid").string(), "--host=" + address_},
                {made(folder) / "log", {}, {}}) {}
  ~DockerEngine() {
    engine_.end(SIGTERM);
    umount2((folder_ / "exec" / "netns" / "default").c_str(), MNT_DETACH);  // it leaves its network mounted
    std::filesystem::remove_all(folder_);
  }
  DockerEngine(const DockerEngine&) = delete;
  DockerEngine& operator=(const DockerEngine&) = delete;
  [[nodiscard]] static bool is_installed() { return shell("command -v dockerd docker").exit_code == 0; }

  /// Where programs find it (DOCKER_HOST).
  [[nodiscard]] const std::string& address() const { return address_; }
  /// Waits until it answers. False: it has ended, or it says nothing for half a minute.
  [[nodiscard]] bool answers() {
    for (int tries = 0; tries < 300 && !engine_.exit_code(); ++tries) {
      if (shell("DOCKER_HOST=" + address_ + " docker info").exit_code == 0) return true;
      poll(nullptr, 0, 100);
    }
    return false;
  }
  /// Gets an image from Podman's store.
  [[nodiscard]] Outcome take(const std::string& image) const {
    const std::string docker = "DOCKER_HOST=" + address_ + " docker ";
    return shell("set -o pipefail; podman save --quiet localhost/" + image + " | " + docker + "load && " + docker +
                 "tag localhost/" + image + " " + image);
  }

 private:
  static const std::filesystem::path& made(const std::filesystem::path& folder) {
    std::filesystem::create_directories(folder);
    return folder;
  }
  std::filesystem::path folder_;
  std::string address_;
  Program engine_;
};

}  // namespace railfix::test
