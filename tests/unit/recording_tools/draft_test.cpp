#include "draft.hpp"

#include <gtest/gtest.h>

#include <sys/wait.h>
#include <unistd.h>

#include <csignal>

#include "unit/dataset/temporary_folder.hpp"

namespace railfix::tool {
namespace {

namespace fs = std::filesystem;

using DraftTest = railfix::testing::TemporaryFolder;

TEST_F(DraftTest, IsGoneUnlessItIsKept) {
  const auto file = write("draft", "half");
  { const Draft draft(file); }
  EXPECT_FALSE(fs::exists(file));
  write("draft", "whole");
  Draft(file).keep();
  EXPECT_TRUE(fs::exists(file));
}

TEST_F(DraftTest, IsGoneWhenTheProgramIsEnded) {
  for (const int signal : {SIGINT, SIGTERM, SIGHUP}) {
    const auto file = write("draft", "half");
    EXPECT_EXIT(
        {
          const Draft draft(file);
          raise(signal);
        },
        ::testing::KilledBySignal(signal), "");
    EXPECT_FALSE(fs::exists(file));
  }
}

TEST_F(DraftTest, IsGoneWheneverTheProgramIsEnded) {
  fs::create_directories(root_ / "films");
  for (useconds_t after_us = 0; after_us < 200; ++after_us) {
    const pid_t child = fork();
    ASSERT_GE(child, 0);
    if (child == 0) {
      while (Draft::beside(root_ / "films/ride", ".mp4").ok()) continue;
      _exit(1);
    }
    usleep(after_us);
    kill(child, SIGTERM);
    int status = 0;
    ASSERT_EQ(waitpid(child, &status, 0), child);
    EXPECT_TRUE(WIFSIGNALED(status) && WTERMSIG(status) == SIGTERM);
    ASSERT_TRUE(fs::is_empty(root_ / "films")) << after_us;
  }
}

TEST_F(DraftTest, WhatIsKeptStaysWhenTheProgramIsEnded) {
  const auto file = write("draft", "whole");
  EXPECT_EXIT(
      {
        Draft(file).keep();
        raise(SIGTERM);
      },
      ::testing::KilledBySignal(SIGTERM), "");
  EXPECT_TRUE(fs::exists(file));
}

TEST_F(DraftTest, AnIgnoredSignalStaysIgnored) {
  const auto file = write("draft", "half");
  EXPECT_EXIT(
      {
        signal(SIGHUP, SIG_IGN);
        const Draft draft(file);
        raise(SIGHUP);
        _exit(fs::exists(file) ? 0 : 1);
      },
      ::testing::ExitedWithCode(0), "");
}

}  // namespace
}  // namespace railfix::tool
