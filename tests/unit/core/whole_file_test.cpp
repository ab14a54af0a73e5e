#include "core/whole_file.hpp"

#include <gtest/gtest.h>
#include <sys/stat.h>
#include <unistd.h>

#include "support/program.hpp"

namespace railfix::core {
namespace {

namespace fs = std::filesystem;

TEST(WholeFile, TakesThePlaceOfTheOldOneAndLeavesNothingBeside) {
  const fs::path folder = fs::path(::testing::TempDir()) / ("railfix-whole-file-" + std::to_string(getpid()));
  fs::create_directories(folder);
  EXPECT_TRUE(write_whole(folder / "file", "old"));
  EXPECT_TRUE(write_whole(folder / "file", std::string("new\0", 4)));
  EXPECT_EQ(test::slurp(folder / "file"), std::string("new\0", 4));
  EXPECT_EQ(std::distance(fs::directory_iterator(folder), fs::directory_iterator()), 1);
  EXPECT_FALSE(write_whole(folder / "none/file", "text"));
  fs::create_directories(folder / "taken/by");
  EXPECT_FALSE(write_whole(folder / "taken", "text"));
  EXPECT_EQ(std::distance(fs::directory_iterator(folder), fs::directory_iterator()), 2);
  fs::remove_all(folder);
}

TEST(WholeFile, IsWrittenThroughLinksAndNeverInPlaceOfADevice) {
  const fs::path folder = fs::path(::testing::TempDir()) / ("railfix-whole-file-" + std::to_string(getpid()));
  fs::create_directories(folder / "there");
  fs::create_symlink("there/file", folder / "link");  // from the link's folder, not from ours; nothing is there yet
  fs::create_symlink(folder / "link", folder / "second");
  for (const std::string text : {"new", "newer"}) {
    EXPECT_TRUE(write_whole(folder / "second", text));
    EXPECT_EQ(test::slurp(folder / "there/file"), text);
    EXPECT_TRUE(fs::is_symlink(folder / "second") && fs::is_symlink(folder / "link"));
  }
  fs::create_symlink("circle", folder / "circle");
  EXPECT_FALSE(write_whole(folder / "circle", "text"));
  EXPECT_TRUE(fs::is_symlink(folder / "circle"));
  ASSERT_EQ(mkfifo((folder / "pipe").c_str(), 0600), 0);  // as a device would be
  fs::create_symlink("pipe", folder / "to-pipe");
  for (const char* name : {"pipe", "to-pipe"}) EXPECT_FALSE(write_whole(folder / name, "text"));
  EXPECT_TRUE(fs::is_fifo(folder / "pipe"));
  EXPECT_EQ(std::distance(fs::directory_iterator(folder), fs::directory_iterator()), 6);
  fs::remove_all(folder);
}

TEST(WholeFile, IsReadToItsEndOrNamed) {
  const fs::path folder = fs::path(::testing::TempDir()) / ("railfix-whole-file-" + std::to_string(getpid()));
  fs::create_directories(folder);
  const std::string bytes = std::string(200'000, 'x') + std::string("\0\r\n", 3);
  for (const auto& text : {std::string(), bytes}) {
    ASSERT_TRUE(write_whole(folder / "file", text));
    EXPECT_EQ(read_whole(folder / "file").value(), text);
  }
  EXPECT_EQ(read_whole(folder).error().message,
            "cannot read " + folder.string() + " (Is a directory); is the path right?");
  EXPECT_EQ(read_whole(folder / "none").error().message,
            "cannot read " + (folder / "none").string() + " (No such file or directory); is the path right?");
  fs::remove_all(folder);
}

}  // namespace
}  // namespace railfix::core
