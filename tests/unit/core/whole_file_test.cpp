#include "core/whole_file.hpp"

#include <gtest/gtest.h>
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
  fs::create_directories(folder / "taken/by");  // a folder with something in it cannot be replaced
  EXPECT_FALSE(write_whole(folder / "taken", "text"));
  EXPECT_EQ(std::distance(fs::directory_iterator(folder), fs::directory_iterator()), 2);
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
