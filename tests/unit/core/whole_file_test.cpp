#include "core/whole_file.hpp"

#include <fcntl.h>
#include <gtest/gtest.h>
#include <sys/stat.h>
#include <unistd.h>

#include <array>

#include "support/program.hpp"

namespace railfix::core {
namespace {

namespace fs = std::filesystem;

/// What is said of a file that cannot be written, after its name.
std::string failure(const fs::path& file) {
  const auto written = write_whole(file, "text");
  const std::string begin = "cannot write " + file.string() + " ";
  if (written.ok() || !written.error().message.starts_with(begin)) return "not: " + written.error().message;
  return written.error().message.substr(begin.size());
}

/// Closes it.
std::string rest_of(int reader) {
  std::array<char, 100> bytes{};
  const auto count = read(reader, bytes.data(), bytes.size());
  close(reader);
  return {bytes.data(), static_cast<size_t>(std::max<ssize_t>(count, 0))};
}

TEST(WholeFile, TakesThePlaceOfTheOldOneAndLeavesNothingBeside) {
  const fs::path folder = fs::path(::testing::TempDir()) / ("railfix-whole-file-" + std::to_string(getpid()));
  fs::create_directories(folder);
  EXPECT_TRUE(write_whole(folder / "file", "old").ok());
  EXPECT_TRUE(write_whole(folder / "file", std::string("new\0", 4)).ok());
  EXPECT_EQ(test::slurp(folder / "file"), std::string("new\0", 4));
  EXPECT_EQ(std::distance(fs::directory_iterator(folder), fs::directory_iterator()), 1);
  EXPECT_EQ(failure(folder / "none/file"), "(No such file or directory); does its folder exist?");
  fs::create_directories(folder / "taken/by");
  EXPECT_EQ(failure(folder / "taken"), "(Is a directory); give the name of a file");
  EXPECT_EQ(std::distance(fs::directory_iterator(folder), fs::directory_iterator()), 2);
  fs::remove_all(folder);
}

TEST(WholeFile, IsWrittenThroughLinksAndNeverInPlaceOfADevice) {
  const fs::path folder = fs::path(::testing::TempDir()) / ("railfix-whole-file-" + std::to_string(getpid()));
  fs::create_directories(folder / "there");
  fs::create_symlink("there/file", folder / "link");  // from the link's folder, not from ours; nothing is there yet
  fs::create_symlink(folder / "link", folder / "second");
  for (const std::string text : {"new", "newer"}) {
    EXPECT_TRUE(write_whole(folder / "second", text).ok());
    EXPECT_EQ(test::slurp(folder / "there/file"), text);
    EXPECT_TRUE(fs::is_symlink(folder / "second") && fs::is_symlink(folder / "link"));
  }
  fs::create_symlink("circle", folder / "circle");
  EXPECT_EQ(failure(folder / "circle"), "(Too many levels of symbolic links); give another place");
  EXPECT_TRUE(fs::is_symlink(folder / "circle"));
  ASSERT_EQ(mkfifo((folder / "pipe").c_str(), 0600), 0);  // as a device would be
  fs::create_symlink("pipe", folder / "to-pipe");
  for (const char* name : {"pipe", "to-pipe"}) {
    EXPECT_EQ(failure(folder / name), "(No such device or address); does anybody read there?");
    const int reader = open((folder / name).c_str(), O_RDONLY | O_NONBLOCK | O_CLOEXEC);
    EXPECT_TRUE(write_whole(folder / name, "text").ok());
    EXPECT_EQ(rest_of(reader), "text");
  }
  EXPECT_TRUE(fs::is_fifo(folder / "pipe"));
  EXPECT_EQ(std::distance(fs::directory_iterator(folder), fs::directory_iterator()), 6);
  fs::remove_all(folder);
}

TEST(WholeFile, GoesIntoWhatIsOpenAlreadyFromWhereItStands) {
  const fs::path folder = fs::path(::testing::TempDir()) / ("railfix-whole-file-" + std::to_string(getpid()));
  fs::create_directories(folder);
  const auto log = folder / "log";
  ASSERT_TRUE(write_whole(log, "old ").ok());
  const int appended = open(log.c_str(), O_WRONLY | O_APPEND | O_CLOEXEC);  // as `>> log` is
  fs::create_symlink("/dev/fd/" + std::to_string(appended), folder / "to-log");
  EXPECT_TRUE(write_whole("/dev/fd/" + std::to_string(appended), "first ").ok());
  EXPECT_TRUE(write_whole("/proc/self/fd/" + std::to_string(appended), "second ").ok());
  EXPECT_TRUE(write_whole("/proc/" + std::to_string(getpid()) + "/fd/" + std::to_string(appended), "third ").ok());
  EXPECT_TRUE(write_whole("/proc/thread-self/fd/" + std::to_string(appended), "fourth ").ok());
  EXPECT_TRUE(write_whole(folder / "to-log", "fifth").ok());
  EXPECT_EQ(test::slurp(log), "old first second third fourth fifth");
  fs::remove(log);
  EXPECT_TRUE(write_whole(folder / "to-log", "into a file without a name").ok());
  close(appended);
  EXPECT_FALSE(write_whole(folder / "to-log", "text").ok());
  EXPECT_EQ(std::distance(fs::directory_iterator(folder), fs::directory_iterator()), 1) << "the link alone";

  std::array<int, 2> pipe{};
  ASSERT_EQ(pipe2(pipe.data(), O_CLOEXEC), 0);
  EXPECT_TRUE(write_whole("/dev/fd/" + std::to_string(pipe[1]), "text").ok());
  close(pipe[1]);
  EXPECT_EQ(rest_of(pipe[0]), "text");
  fs::remove_all(folder);
}

TEST(WholeFile, KeepsOwnerAndRightsOfTheOldOne) {
  const fs::path folder = fs::path(::testing::TempDir()) / ("railfix-whole-file-" + std::to_string(getpid()));
  fs::create_directories(folder);
  ASSERT_TRUE(write_whole(folder / "file", "old").ok());
  const bool root = geteuid() == 0;
  if (root) {
    ASSERT_EQ(chown((folder / "file").c_str(), 12345, 12346), 0);
  }
  for (const mode_t mode : {0600, 0666, 0640}) {
    ASSERT_EQ(chmod((folder / "file").c_str(), mode), 0);
    ASSERT_TRUE(write_whole(folder / "file", "new").ok());
    struct stat is {};
    ASSERT_EQ(stat((folder / "file").c_str(), &is), 0);
    EXPECT_EQ(is.st_mode & 07777U, mode);
    EXPECT_EQ(is.st_uid, root ? 12345 : geteuid());
    EXPECT_EQ(is.st_gid, root ? 12346 : getegid());
  }
  ASSERT_EQ(chmod((folder / "file").c_str(), 0444), 0);
  if (!root) {
    EXPECT_EQ(failure(folder / "file"), "(Permission denied); give a place where you may write");
  }
  fs::remove_all(folder);
}

TEST(Draft, TakesOwnerAndRightsAndThenThePlace) {
  const fs::path folder = fs::path(::testing::TempDir()) / ("railfix-whole-file-" + std::to_string(getpid()));
  fs::create_directories(folder / "there");
  ASSERT_TRUE(write_whole(folder / "there/film.mp4", "old").ok());
  fs::permissions(folder / "there/film.mp4", fs::perms::owner_read | fs::perms::owner_write | fs::perms::group_read);
  fs::create_symlink("there/film.mp4", folder / "link");
  const auto draft = draft_beside(folder / "link", ".mp4");
  ASSERT_TRUE(draft.ok()) << draft.error().message;
  EXPECT_EQ(draft.value().parent_path().filename(), "there") << "so that it can be moved";
  EXPECT_EQ(draft.value().extension(), ".mp4");
  EXPECT_EQ(test::slurp(folder / "link"), "old");
  ASSERT_TRUE(write_whole(draft.value(), "new").ok());
  ASSERT_TRUE(move_draft(draft.value(), folder / "link").ok());
  EXPECT_TRUE(fs::is_symlink(folder / "link"));
  EXPECT_EQ(test::slurp(folder / "there/film.mp4"), "new");
  EXPECT_EQ(fs::status(folder / "there/film.mp4").permissions(),
            fs::perms::owner_read | fs::perms::owner_write | fs::perms::group_read);
  EXPECT_EQ(std::distance(fs::directory_iterator(folder / "there"), fs::directory_iterator()), 1);
  fs::remove_all(folder);
}

TEST(Draft, IsOfARegularFileThatMayBeWritten) {
  const fs::path folder = fs::path(::testing::TempDir()) / ("railfix-whole-file-" + std::to_string(getpid()));
  fs::create_directories(folder);
  EXPECT_EQ(draft_beside("/dev/null", ".mp4").error().message,
            "cannot write /dev/null: it is no regular file; give the name of one");
  EXPECT_EQ(draft_beside(folder / "none/film", "").error().message,
            "cannot write " + (folder / "none/film").string() + " (No such file or directory); does its folder exist?");
  ASSERT_TRUE(write_whole(folder / "precious", "text").ok());
  fs::permissions(folder / "precious", fs::perms::owner_read);
  EXPECT_FALSE(draft_beside(folder / "precious", "").ok());
  EXPECT_EQ(std::distance(fs::directory_iterator(folder), fs::directory_iterator()), 1);
  fs::remove_all(folder);
}

TEST(WholeFile, SaysWhyItCannotBeWritten) {
  EXPECT_EQ(failure("/dev/full"), "(No space left on device); make space there");
  EXPECT_EQ(failure(fs::path(::testing::TempDir()) / std::string(300, 'x')),
            "(File name too long); give a shorter name");
  EXPECT_EQ(failure("/dev/null/file"), "(Not a directory); does its folder exist?");
}

TEST(WholeFile, IsReadToItsEndOrNamed) {
  const fs::path folder = fs::path(::testing::TempDir()) / ("railfix-whole-file-" + std::to_string(getpid()));
  fs::create_directories(folder);
  const std::string bytes = std::string(200'000, 'x') + std::string("\0\r\n", 3);
  for (const auto& text : {std::string(), bytes}) {
    ASSERT_TRUE(write_whole(folder / "file", text).ok());
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
