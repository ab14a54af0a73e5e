#include "tpr_publisher/ground_link/report_store.hpp"

#include <fcntl.h>
#include <gmock/gmock.h>
#include <sched.h>
#include <sys/mount.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <csignal>
#include <fstream>
#include <iostream>

#include "core/random.hpp"
#include "ground_link/ground_report.hpp"

namespace railfix::tpr_publisher {
namespace {

namespace fs = std::filesystem;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

/// In memory where there is a folder for it: thousands of stores are opened, and a killed process needs no disk.
fs::path scratch() {
  return fs::exists("/dev/shm") ? fs::path("/dev/shm") : fs::temp_directory_path();
}

std::vector<uint8_t> report_of(uint64_t sequence) {
  std::vector<uint8_t> bytes(20 + sequence % 60);
  for (size_t i = 0; i < bytes.size(); ++i) bytes[i] = static_cast<uint8_t>(sequence * 31 + i);
  return bytes;
}

class Store : public ::testing::Test {
 protected:
  Store() { fs::create_directories(folder_); }
  ~Store() override { fs::remove_all(folder_); }
  void clear() {
    fs::remove_all(folder_);
    fs::create_directories(folder_);
  }
  static ReportStore opened(const fs::path& file) { return core::value_or_throw(ReportStore::open(file)); }
  /// The reports that are there, each checked against what was put in.
  static std::vector<uint64_t> whole_reports(const ReportStore& store) {
    const auto sequences = store.sequences();
    if (!sequences.ok()) return {};
    for (const uint64_t sequence : sequences.value()) {
      const auto bytes = store.read(sequence);
      EXPECT_TRUE(bytes.ok() && bytes.value() == report_of(sequence)) << sequence;
    }
    return sequences.value();
  }
  fs::path folder_ = scratch() / ("report-store-" + std::to_string(getpid()));
  fs::path file_ = folder_ / "reports.db";
};

TEST_F(Store, KeepsReportsAndNeverGivesANumberTwice) {
  uint64_t stream = 0;
  {
    auto store = opened(file_);
    stream = store.stream();
    for (uint64_t i = 1; i <= 3; ++i) ASSERT_EQ(store.append(report_of(i)).value(), i);
    ASSERT_TRUE(store.remove(std::vector<uint64_t>{1, 3}).ok());
  }
  auto store = opened(file_);
  EXPECT_EQ(store.problem(), "");
  EXPECT_EQ(store.stream(), stream);
  EXPECT_THAT(whole_reports(store), ElementsAre(2U));
  EXPECT_EQ(store.append(report_of(4)).value(), 4U);
}

// So much disk does `railfix train check` ask for (tools/railfix/train/disk_need.hpp).
TEST_F(Store, AReportTakesNoMoreThan256Bytes) {
  constexpr uint64_t kReports = 10'000;
  const ground_link::GroundReport longest{
      std::string(30, 't'),     ~uint64_t{0},        10'000'000, INT64_MAX, INT64_MAX, 4, 10,
      std::vector<uint8_t>(60), std::string(20, 'h')};
  auto store = opened(file_);
  for (uint64_t i = 1; i <= kReports; ++i) ASSERT_TRUE(store.append(ground_link::to_bytes(longest)).ok());
  uintmax_t bytes = 0;
  for (const auto& entry : fs::directory_iterator(folder_)) bytes += entry.file_size();
  EXPECT_LE(bytes, kReports * 256 + 2'000'000) << "with the log of 1000 pages";
}

TEST_F(Store, OneServiceOnly) {
  auto store = opened(file_);
  ASSERT_TRUE(store.append(report_of(1)).ok());
  const auto second = ReportStore::open(file_);
  ASSERT_FALSE(second.ok());
  EXPECT_THAT(second.error().message, HasSubstr("locked"));
}

TEST_F(Store, APlaceThatCannotBeWrittenIsSaid) {
  EXPECT_THAT(ReportStore::open("/no/such/folder/reports.db").error().message, HasSubstr("/no/such/folder/reports.db"));
}

TEST_F(Store, ACutLogLosesOnlyWhatLayBehindTheCut) {
  constexpr uint64_t kReports = 2;
  const fs::path log = folder_ / "reports.db-wal";
  const fs::path copy = folder_ / "copy.db";
  std::vector<uintmax_t> whole_at;  // length of the log when this many reports were in
  auto store = opened(file_);
  whole_at.push_back(fs::file_size(log));
  for (uint64_t i = 1; i <= kReports; ++i) {
    ASSERT_TRUE(store.append(report_of(i)).ok());
    whole_at.push_back(fs::file_size(log));
  }
  const auto length = fs::file_size(log);
  fs::copy_file(file_, folder_ / "base.db");
  std::ifstream stream(log, std::ios::binary);
  const std::string bytes{std::istreambuf_iterator<char>(stream), {}};
  for (uintmax_t cut = 0; cut <= length; ++cut) {
    fs::copy_file(folder_ / "base.db", copy, fs::copy_options::overwrite_existing);
    std::ofstream(folder_ / "copy.db-wal", std::ios::binary) << bytes.substr(0, cut);
    const auto survivor = opened(copy);
    size_t promised = 0;
    while (promised < kReports && whole_at[promised + 1] <= cut) ++promised;
    ASSERT_EQ(survivor.problem(), "");
    ASSERT_EQ(whole_reports(survivor).size(), promised) << "cut at byte " << cut;
  }
}

TEST_F(Store, ACutFileIsMovedAsideOrReadable) {
  {
    auto store = opened(file_);
    for (uint64_t i = 1; i <= 3; ++i) ASSERT_TRUE(store.append(report_of(i)).ok());
  }
  std::ifstream stream(file_, std::ios::binary);
  const std::string bytes{std::istreambuf_iterator<char>(stream), {}};
  int aside = 0;
  for (size_t cut = 0; cut < bytes.size(); cut += cut < 1200 ? 1 : 7) {
    clear();
    std::ofstream(file_, std::ios::binary) << bytes.substr(0, cut);
    auto store = opened(file_);
    whole_reports(store);
    ASSERT_TRUE(store.append(report_of(1)).ok());
    if (store.problem().empty()) continue;
    ++aside;
    ASSERT_THAT(store.problem(), HasSubstr("reports.db.damaged"));
    ASSERT_EQ(fs::file_size(folder_ / "reports.db.damaged"), cut);
  }
  EXPECT_GT(aside, 0);
}

TEST_F(Store, WhatIsMovedAsideIsCountedWhereItCanBeAndNeverLost) {
  for (const char* aside : {"reports.db.damaged", "reports.db.damaged-2", "reports.db.damaged-3"}) {
    {
      auto store = opened(file_);
      for (uint64_t i = 1; i <= 60; ++i) ASSERT_TRUE(store.append(report_of(i)).ok());
    }
    {  // the page behind the first of the reports: the number of rows stands elsewhere
      std::fstream stream(file_, std::ios::binary | std::ios::in | std::ios::out);
      stream.seekp(static_cast<std::streamoff>(fs::file_size(file_) - 1020));
      stream << std::string(40, '\xFF');
    }
    const auto store = opened(file_);
    EXPECT_THAT(store.problem(), HasSubstr("moved to " + (folder_ / aside).string() + ", with "));
    EXPECT_GT(fs::file_size(folder_ / aside), 1000U);
  }
  fs::remove(folder_ / "reports.db.damaged-2");
  const auto store = opened(file_);
  EXPECT_EQ(store.problem(), "");
  EXPECT_THAT(store.remark(), HasSubstr("reports.db.damaged, "));
  EXPECT_THAT(store.remark(), HasSubstr("reports.db.damaged-3: look at"));
}

// A disk that the system has remounted after errors.
TEST_F(Store, OfAReadOnlyDiskItSaysSo) {
  int said[2];
  ASSERT_EQ(pipe(said), 0);
  const pid_t child = fork();
  if (child == 0) {
    const bool may = unshare(CLONE_NEWNS) == 0 && mount("", "/", "", MS_REC | MS_PRIVATE, nullptr) == 0 &&
                     mount("disk", folder_.c_str(), "tmpfs", 0, nullptr) == 0;
    if (!may) _exit(2);
    { opened(file_); }
    if (mount("disk", folder_.c_str(), "tmpfs", MS_REMOUNT | MS_RDONLY, nullptr) != 0) _exit(2);
    const auto store = ReportStore::open(file_);
    const std::string text = store.ok() ? "" : store.error().message;
    _exit(write(said[1], text.data(), text.size()) == static_cast<ssize_t>(text.size()) ? 0 : 1);
  }
  close(said[1]);
  std::array<char, 1000> text{};
  const auto bytes = read(said[0], text.data(), text.size() - 1);
  close(said[0]);
  int status = 0;
  waitpid(child, &status, 0);
  if (WEXITSTATUS(status) == 2) GTEST_SKIP() << "may mount nothing";
  ASSERT_GE(bytes, 0);
  EXPECT_THAT(text.data(), HasSubstr("reports.db: "));
  EXPECT_THAT(text.data(), HasSubstr("; its disk is read-only."));
}

TEST_F(Store, ADamagedReportIsNotSent) {
  {
    auto store = opened(file_);
    ASSERT_TRUE(store.append(report_of(1)).ok());
  }
  std::fstream stream(file_, std::ios::binary | std::ios::in | std::ios::out);
  const std::string bytes{std::istreambuf_iterator<char>(stream), {}};
  const auto report = report_of(1);
  const auto place = bytes.find(std::string(report.begin(), report.end()));
  ASSERT_NE(place, std::string::npos);
  stream.seekp(static_cast<std::streamoff>(place));
  stream.put('\0');
  stream.close();
  const auto store = opened(file_);
  const auto damaged = store.read(1);
  ASSERT_TRUE(damaged.ok()) << damaged.error().message;
  EXPECT_FALSE(damaged.value().has_value());
  EXPECT_FALSE(store.read(2).value().has_value()) << "was never there";
}

/// While it lives, reading the file fails, as on a disk that is gone for a moment.
class Unreadable {
 public:
  explicit Unreadable(const fs::path& file) {
    for (const auto& entry : fs::directory_iterator("/proc/self/fd")) {
      std::error_code gone;
      if (fs::read_symlink(entry, gone) == file) fd_ = std::stoi(entry.path().filename());
    }
    EXPECT_GE(fd_, 0);
    kept_ = dup(fd_);
    const int write_only = ::open(file.c_str(), O_WRONLY | O_CLOEXEC);
    dup2(write_only, fd_);
    close(write_only);
  }
  ~Unreadable() {
    dup2(kept_, fd_);
    close(kept_);
  }
  Unreadable(const Unreadable&) = delete;
  Unreadable& operator=(const Unreadable&) = delete;

 private:
  int fd_ = -1;
  int kept_ = -1;
};

TEST_F(Store, AReportThatCannotBeReadNowIsReadLater) {
  constexpr uint64_t kReports = 4000;  // not all of them stay in SQLite's memory: the last is looked at first
  const std::vector<uint8_t> report(1000, 7);
  {
    auto store = opened(file_);
    for (uint64_t i = 0; i < kReports; ++i) ASSERT_TRUE(store.append(report).ok());
  }
  const auto store = opened(file_);
  {
    const Unreadable disk(file_);
    const auto read = store.read(kReports);
    ASSERT_FALSE(read.ok()) << "an error is not taken for a damaged report";
    EXPECT_THAT(read.error().message, HasSubstr("I/O error"));
  }
  EXPECT_EQ(store.read(kReports).value(), report);
}

/// Appends until it is killed, and tells each number once append() has promised it. REQUIRES: runs in a child.
[[noreturn]] void append_for_ever(const fs::path& file, int promise) {
  auto store = ReportStore::open(file);
  const auto there = store.ok() ? store.value().sequences() : core::Result<std::vector<uint64_t>>(core::Error{""});
  if (!there.ok()) _exit(1);
  for (uint64_t next = there.value().empty() ? 1 : there.value().back() + 1;; ++next) {
    const auto sequence = store.value().append(report_of(next));
    if (!sequence.ok() || sequence.value() != next) _exit(1);
    if (write(promise, &next, sizeof next) != sizeof next) _exit(1);
  }
}

TEST_F(Store, WhatWasPromisedSurvivesSigkill) {
  constexpr int kKills = 40;
  core::Random random(8);
  uint64_t promised = 0;
  uint64_t first = 1;
  for (int kill_count = 0; kill_count < kKills; ++kill_count) {
    int promises[2];
    ASSERT_EQ(pipe(promises), 0);
    const pid_t child = fork();
    if (child == 0) append_for_ever(file_, promises[1]);
    close(promises[1]);
    const uint64_t until = promised + 1 + random.next() % 12;
    while (promised < until) {
      uint64_t sequence = 0;
      ASSERT_EQ(read(promises[0], &sequence, sizeof sequence), static_cast<ssize_t>(sizeof sequence));
      ASSERT_EQ(sequence, promised + 1);
      promised = sequence;
    }
    usleep(static_cast<useconds_t>(random.next() % 2000));  // anywhere inside the next ones
    kill(child, SIGKILL);
    for (uint64_t sequence = 0; read(promises[0], &sequence, sizeof sequence) == sizeof sequence;) promised = sequence;
    close(promises[0]);
    waitpid(child, nullptr, 0);
    auto store = opened(file_);
    ASSERT_EQ(store.problem(), "");
    const auto there = whole_reports(store);
    ASSERT_FALSE(there.empty());
    ASSERT_EQ(there.front(), first);
    ASSERT_EQ(there.size(), there.back() - first + 1);
    ASSERT_GE(there.back(), promised);
    ASSERT_LE(there.back(), promised + 1);  // written, but killed before it could say so
    promised = first = there.back();
    ASSERT_TRUE(store.remove(std::span(there).first(there.size() - 1)).ok());
  }
  std::cout << kKills << " kills, " << promised << " reports, 0 lost\n";
}

}  // namespace
}  // namespace railfix::tpr_publisher
