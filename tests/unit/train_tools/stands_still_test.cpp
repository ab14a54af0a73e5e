#include "train/stands_still.hpp"

#include <fcntl.h>
#include <gtest/gtest.h>
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

namespace railfix::tool {
namespace {

TEST(StandsStill, TheHolderOfAFileIsFoundAndWhetherItIsStopped) {
  const auto path = std::filesystem::temp_directory_path() / ("railfix-holder-" + std::to_string(getpid()));
  int ready[2];
  ASSERT_EQ(pipe(ready), 0);
  EXPECT_EQ(holder_of(path), 0);
  const pid_t holder = fork();
  if (holder == 0) {
    if (open(path.c_str(), O_WRONLY | O_CREAT | O_CLOEXEC, 0644) < 0 || write(ready[1], "x", 1) != 1) _exit(1);
    raise(SIGSTOP);
    _exit(0);
  }
  char x = 0;
  ASSERT_EQ(read(ready[0], &x, 1), 1);
  int status = 0;
  ASSERT_EQ(waitpid(holder, &status, WUNTRACED), holder);
  EXPECT_EQ(holder_of(path), holder);
  EXPECT_TRUE(stands_still(holder));
  kill(holder, SIGCONT);
  ASSERT_EQ(waitpid(holder, &status, 0), holder);
  EXPECT_EQ(holder_of(path), 0);
  EXPECT_FALSE(stands_still(holder));
  std::filesystem::remove(path);
}

}  // namespace
}  // namespace railfix::tool
