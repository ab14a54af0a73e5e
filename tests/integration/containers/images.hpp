// Images of this build, made once for all tests of this program.
#pragma once

#include <gtest/gtest.h>

#include "podman.hpp"

namespace railfix::test {

/// Images railfix/SERVICE:test of this build's frame_grabber, fusion, tpr_publisher and monitor, with Podman.
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
  static void make() {
    skipped_ = why_no_podman();
    if (!skipped_.empty()) return;
    if (!std::filesystem::exists(RAILFIX_BUILD_DIR "/share/monitor/page/index.html")) {
      skipped_ = "the monitor's page is not built, which npm does";
      return;
    }
    std::filesystem::create_directories(kWork);
    const auto programs = "'" + (kWork / "programs").string() + "'";
    const auto built = shell("cd '" + kSource.string() + "' && docker/collect '" RAILFIX_BUILD_DIR "' " + programs +
                             " && docker/build --engine podman --release test --programs " + programs +
                             " frame-grabber fusion tpr-publisher monitor");
    if (built.exit_code == 0) return;
    const bool no_network = is_no_network(built);
    (no_network ? skipped_ : failed_) =
        (no_network ? "Debian's packages cannot be fetched in a container here: " : "") + built.out + built.err;
  }
  inline static std::string skipped_;
  inline static std::string failed_;
};

}  // namespace railfix::test
