// The files of a host's folder, as they are written and as a broken disk may give them back.
#include "train/plan.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sched.h>
#include <sys/mount.h>
#include <sys/wait.h>
#include <unistd.h>

#include <fstream>

#include "train/log_file.hpp"

namespace railfix::tool {
namespace {

namespace fs = std::filesystem;
using ::testing::AllOf;
using ::testing::HasSubstr;

class HostFiles : public ::testing::Test {
 protected:
  ~HostFiles() override { fs::remove_all(root_); }
  void write(const char* name, const std::string& text) const {
    fs::create_directories(folder_.plan_file().parent_path());
    std::ofstream(folder_.plan_file().parent_path() / name) << text;
  }
  template <class Read>
  static std::string told(Read read) {
    try {
      static_cast<void>(read());
    } catch (const core::BadInput& damaged) {
      return damaged.what();
    }
    return "nothing";
  }
  const fs::path root_ = fs::temp_directory_path() / ("railfix-host-files-" + std::to_string(getpid()));
  const HostFolder folder_{root_};
};

TEST_F(HostFiles, AreReadAsTheyWereWritten) {
  EXPECT_FALSE(folder_.plan());
  EXPECT_TRUE(folder_.state().empty());
  HostPlan plan{"t", "cab", 3, 2, true, {{"fusion", "1.0", 3, false, {"/bin/true", "x"}, {}, "a: b\n"}}};
  ASSERT_TRUE(folder_.write(plan).ok());
  const auto read = folder_.plan();
  ASSERT_TRUE(read);
  EXPECT_EQ(read->services, plan.services);
  EXPECT_TRUE(read->down);
  plan.services.clear();  // a host that every service has left
  ASSERT_TRUE(folder_.write(plan).ok());
  EXPECT_TRUE(folder_.plan()->services.empty());
  ASSERT_TRUE(folder_.write(HostState{{"fusion", {7, 3, 1, "ended", false, 9, true}}}).ok());
  EXPECT_EQ(folder_.state().at("fusion").pid, 7);
  EXPECT_TRUE(folder_.state().at("fusion").refused);
}

// Another process may have the number, and even the start time, of one of before.
TEST_F(HostFiles, ProcessesOfBeforeTheComputersStartAreForgotten) {
  ASSERT_TRUE(folder_.write(HostState{{"fusion", {7, 3, 1, "ended", false, 9, false}}}).ok());
  std::ifstream in(root_ / "var/lib/railfix-train/state.yaml");
  std::string text{std::istreambuf_iterator<char>(in), {}};
  const size_t id = text.find("boot_id: ") + 9;
  text.replace(id, 8, "00000000");
  write("state.yaml", text);
  EXPECT_TRUE(folder_.state().empty());
}

TEST_F(HostFiles, ThatAreDamagedAreTold) {
  const auto plan = [&](const std::string& text) {
    write("plan.yaml", text);
    return told([&] { return folder_.plan(); });
  };
  const std::string head = "train_id: t\nhost: cab\ngeneration: 3\nprevious: 2\n";
  EXPECT_EQ(plan(head + "services: []\n"), "nothing");
  EXPECT_THAT(plan(""), AllOf(HasSubstr("plan.yaml is damaged ("), HasSubstr("); remove it, then railfix train up")));
  EXPECT_THAT(plan("train_id: ["), HasSubstr("plan.yaml is damaged (yaml-cpp: error at line 1"));
  EXPECT_THAT(plan(head), HasSubstr("first invalid key: \"services\""));
  EXPECT_THAT(plan(head + "services: x\n"), HasSubstr("no list of services")) << "the supervisor would end everything";
  EXPECT_THAT(plan(head + "services: [{name: fusion, release: a, generation: x, standby: false, command: [y]}]\n"),
              HasSubstr("error at line 5"));
  EXPECT_THAT(plan(head + "services: [{name: fusion, release: a, generation: 1, standby: false, command: []}]\n"),
              HasSubstr("a service without a command"));
  write("state.yaml", "fusion: {pid: many}\n");
  EXPECT_THAT(told([&] { return folder_.state(); }), HasSubstr("state.yaml is damaged (yaml-cpp: error at line 1"));
}

// Services may hold their log for years.
TEST_F(HostFiles, ALongLogIsKeptOnceAndBeginsAnew) {
  const auto log = folder_.log("fusion");
  const auto write_line = [&](const std::string& line) {
    const int file = open_log(log);
    ASSERT_GE(file, 0);
    ASSERT_EQ(::write(file, line.data(), line.size()), static_cast<ssize_t>(line.size()));
    close(file);
  };
  const auto bytes_of = [](const fs::path& file) { return fs::exists(file) ? fs::file_size(file) : 0; };
  write_line("first");
  write_line("second");
  EXPECT_EQ(bytes_of(log), 11U);
  fs::resize_file(log, 20'000'001);
  write_line("third");
  EXPECT_EQ(bytes_of(log), 5U);
  EXPECT_EQ(bytes_of(log.string() + ".1"), 20'000'001U);
  fs::resize_file(log, 20'000'002);
  write_line("fourth");
  EXPECT_EQ(bytes_of(log.string() + ".1"), 20'000'002U);
}

TEST_F(HostFiles, CommandsWithSpacesInTheirPathsCanBePasted) {
  HostPlan plan;
  plan.train_folder = "/srv/re460";
  EXPECT_EQ(plan.train() + at_root("/"), "/srv/re460");
  plan.train_folder = "/srv/the train's";
  EXPECT_EQ(plan.train() + at_root("/mnt/a b"), "'/srv/the train'\\''s' --root '/mnt/a b'");
}

TEST_F(HostFiles, ADiskThatIsMountedReadOnlyIsToldAsSuch) {
  if (geteuid() != 0) GTEST_SKIP() << "needs root, for a mount of its own";
  fs::create_directories(root_);
  const pid_t child = fork();
  if (child == 0) {
    const bool mounted = unshare(CLONE_NEWNS) == 0 && mount("none", "/", nullptr, MS_REC | MS_PRIVATE, nullptr) == 0 &&
                         mount("tmpfs", root_.c_str(), "tmpfs", MS_RDONLY, "size=1M") == 0;
    const auto may = folder_.may_be_changed();
    const bool told =
        !may.ok() && may.error().message == root_.string() +
                                                " is mounted read-only; mount -o remount,rw makes it "
                                                "writable again, and dmesg says whether the disk is broken";
    _exit(!mounted ? 2 : told ? 1 : 0);
  }
  int status = 0;
  waitpid(child, &status, 0);
  if (WEXITSTATUS(status) == 2) GTEST_SKIP() << "this user may not mount";
  EXPECT_EQ(WEXITSTATUS(status), 1);
}

}  // namespace
}  // namespace railfix::tool
