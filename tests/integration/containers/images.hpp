// Images of this build, made once for all tests of this program.
#pragma once

#include <gtest/gtest.h>

#include "support/program.hpp"

namespace railfix::test {

inline Outcome shell(const std::string& commands) {
  return run_program({"/bin/bash", "-c", commands}, 600);
}

/// Images railfix/SERVICE:test of this build's fusion and tpr_publisher, with Podman.
class Images : public ::testing::Test {
 protected:
  static void SetUpTestSuite() {
    static const bool once = (make(), true);
    static_cast<void>(once);
  }
  void SetUp() override {
    if (!skipped_.empty()) GTEST_SKIP() << "skipped: " << skipped_;
    ASSERT_EQ(failed_, "");
  }
  inline static const std::filesystem::path kWork = CONTAINERS_WORK;
  inline static const std::filesystem::path kSource = RAILFIX_SOURCE_DIR;

 private:
  static constexpr const char* kEngineConf = "/etc/containers/railfix-containers.conf";
  static std::string why_not() {
    const std::string base = "docker.io/library/debian:bookworm-slim";
    if (geteuid() != 0) return "containers of a train need root";
    if (shell("podman image inspect " + base).exit_code != 0)
      return "podman with the image " + base + " is not here; ../shared/container-engine/setup makes both";
    const auto trial = shell("podman run --rm --init " + base + " true");
    return trial.exit_code == 0 ? "" : "podman cannot run containers here: " + trial.err;
  }
  static void make() {
    if (std::filesystem::exists(kEngineConf)) setenv("CONTAINERS_CONF", kEngineConf, 0);
    skipped_ = why_not();
    if (!skipped_.empty()) return;
    std::filesystem::create_directories(kWork);
    const auto programs = "'" + (kWork / "programs").string() + "'";
    const auto built =
        shell("cd '" + kSource.string() + "' && docker/collect '" RAILFIX_BUILD_DIR "' " + programs +
              " && docker/build --engine podman --release test --programs " + programs + " fusion tpr-publisher");
    if (built.exit_code == 0) return;
    const std::string said = built.out + built.err;
    const bool no_network =
        said.find("Failed to fetch") != std::string::npos || said.find("Unable to fetch") != std::string::npos;
    (no_network ? skipped_ : failed_) =
        (no_network ? "Debian's packages cannot be fetched in a container here: " : "") + said;
  }
  inline static std::string skipped_;
  inline static std::string failed_;
};

}  // namespace railfix::test
