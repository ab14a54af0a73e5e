// What a computer of the train lacks: said before anything is installed.
#include <gmock/gmock.h>
#include <sched.h>
#include <sys/mount.h>
#include <sys/wait.h>
#include <unistd.h>

#include "recorder/recorder_config.hpp"
#include "support/loopback.hpp"
#include "tpr_publisher/tpr_publisher_config.hpp"
#include "train/disk_need.hpp"
#include "unit/train_tools/train_folder.hpp"

namespace railfix::tool {
namespace {

using ::testing::AllOf;
using ::testing::Contains;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;

TEST_F(TrainFolder, AComputerThatIsNotSetUpIsTold) {
  const auto conf = YAML::Load(
      "{net.core.rmem_max: 212992, net.core.wmem_max: 212992, net.ipv4.ipfrag_time: 30, "
      "net.ipv4.ipfrag_high_thresh: 4194304}");
  const auto set = [&](const std::string& name, const std::string& value) {
    std::string path = name;
    std::replace(path.begin(), path.end(), '.', '/');
    fs::create_directories((folder_ / path).parent_path());
    std::ofstream(folder_ / path) << value << '\n';
  };
  for (const auto& entry : conf) set(entry.first.Scalar(), entry.second.Scalar());
  const auto found = check_kernel(folder_);
  ASSERT_EQ(found.size(), conf.size()) << "as Linux begins";
  EXPECT_THAT(found[2].text, HasSubstr("net.ipv4.ipfrag_time is 30, so long that lost fragments block the link"));
  std::ifstream ours(std::string(RAILFIX_SOURCE_DIR) + "/deploy/host/60-railfix.conf");
  for (std::string name, equals, value; ours >> name;) {
    if (name.starts_with("net.")) ours >> equals >> value, set(name, value);
  }
  EXPECT_THAT(check_kernel(folder_), IsEmpty()) << "60-railfix.conf sets it";
}

TEST_F(TrainFolder, AnAddressThatThisComputerHasNotIsTold) {
  const auto told = [&](const std::string& address) {
    const auto train = manifest(kTrain, "10.42.1.11", address).value();
    std::vector<std::string> texts;
    for (const auto& finding : check_computer(&train, train.host("cab"), folder_)) texts.push_back(finding.text);
    return texts;
  };
  EXPECT_THAT(told("203.0.113.7"), Contains(AllOf(HasSubstr("host cab: "), HasSubstr("203.0.113.7"))));
  EXPECT_THAT(told("127.0.0.1"), Not(Contains(HasSubstr("host cab: "))));
}

TEST_F(TrainFolder, APageThatCannotBeServedOnThisComputerIsTold) {
  const auto told = [&](const std::string& address) {
    auto train = manifest(kTrain).value();
    train.settings["monitor"]["address"] = address;
    EXPECT_THAT(check_page(train, *train.host("cab"), folder_), IsEmpty()) << "it stands in the coach";
    const auto findings = check_page(train, *train.host("coach"), folder_);
    return findings.empty() ? "" : (findings[0].error ? "error: " : "warning: ") + findings[0].text;
  };
  for (const char* right : {"", "127.0.0.1", "0.0.0.0", "::"})
    EXPECT_THAT(told(right), Not(HasSubstr("address"))) << right;
  EXPECT_THAT(told("203.0.113.7"), HasSubstr("error: settings.monitor.address: 203.0.113.7 is not an address of this"));
  EXPECT_THAT(told("localhost"), HasSubstr("error: settings.monitor.address: localhost is no IP address"));
}

TEST_F(TrainFolder, APortThatAnotherProgramHasIsTold) {
  const int other = test::tcp_socket();
  const auto port = std::to_string(test::bind_to_loopback(other));
  ASSERT_EQ(listen(other, 1), 0);
  const auto told = [&](const char* search) {
    auto train = manifest(kTrain, "10.42.1.12", "127.0.0.1").value();
    train.settings["monitor"]["port"] = port;
    train.settings["monitor"]["port_search"] = search;
    const auto findings = check_page(train, *train.host("coach"), folder_);
    return findings.empty() ? "" : (findings[0].error ? "error: " : "warning: ") + findings[0].text;
  };
  EXPECT_THAT(told("20"), HasSubstr("warning: settings.monitor.port: " + port + " is taken on this computer"));
  EXPECT_THAT(told("0"), AllOf(HasSubstr("error: "), HasSubstr("the monitor would not start")));
  close(other);
  EXPECT_EQ(told("20"), "");
}

TEST_F(TrainFolder, AReleaseThatIsNotOnTheComputerIsAnError) {
  const auto told = [&](const char* host) {
    const auto train = manifest(kTrain).value();
    std::vector<std::string> texts;
    for (const auto& finding : check_computer(&train, train.host(host), folder_)) {
      if (finding.error) texts.push_back(finding.text);
    }
    return texts;
  };
  const auto missing = HasSubstr("release 1.3.0 of fusion is not installed on this computer: " + folder_.string());
  EXPECT_THAT(told("coach"), Contains(missing));
  const auto bin = folder_ / "opt/railfix/1.3.0/bin";
  fs::create_directories(bin);
  std::ofstream(bin / "railfix-fusion") << "a program";
  EXPECT_THAT(told("coach"), Not(Contains(missing)));
}

TEST_F(TrainFolder, SharedMemoryThatIsTooSmallForPicturesIsTold) {
  if (geteuid() != 0) GTEST_SKIP() << "needs root, for a /dev/shm of its own";
  const auto train = manifest(kTrain).value();
  const auto told_with = [&](const char* size) {
    const pid_t child = fork();
    if (child == 0) {
      const bool own = unshare(CLONE_NEWNS) == 0 && mount("none", "/", nullptr, MS_REC | MS_PRIVATE, nullptr) == 0 &&
                       mount("tmpfs", "/dev/shm", "tmpfs", 0, size) == 0;
      const auto findings = check_computer(&train, train.host("cab"), folder_);
      const bool told = std::ranges::any_of(
          findings, [](const auto& finding) { return finding.error && finding.text.starts_with("/dev/shm has "); });
      _exit(!own ? 2 : told ? 1 : 0);
    }
    int status = 0;
    waitpid(child, &status, 0);
    return WEXITSTATUS(status);
  };
  EXPECT_EQ(told_with("size=64M"), 1);
  EXPECT_EQ(told_with("size=1G"), 0);
}

TEST_F(TrainFolder, AClockThatSaysLessThanWhatIsThereIsWrong) {
  constexpr int64_t kYearS = 365 * 86400;
  const auto old = folder_ / "old.yaml";
  const auto young = folder_ / "young.yaml";
  for (const auto& file : {old, young}) std::ofstream(file) << "x";
  fs::last_write_time(old, fs::last_write_time(young) - std::chrono::hours(48));
  const int64_t now_s = time(nullptr);
  EXPECT_THAT(check_clock_date({old, young, folder_ / "missing"}, now_s), IsEmpty());
  EXPECT_THAT(check_clock_date({old, young}, now_s - 1800), IsEmpty()) << "written on another computer";
  const auto found = check_clock_date({young, old}, 1'000'000'000);
  ASSERT_EQ(found.size(), 1U);
  EXPECT_TRUE(found[0].error);
  EXPECT_THAT(found[0].text, AllOf(HasSubstr("it says 2001-09-09 01:46 UTC, but " + young.string() + " is of 20"),
                                   HasSubstr("chronyc makestep"), HasSubstr("touch " + young.string())));
  const auto train = manifest(kTrain).value();
  const timespec next_year[2]{{now_s + kYearS, 0}, {now_s + kYearS, 0}};
  ASSERT_EQ(utimensat(AT_FDCWD, (folder_ / "train.yaml").c_str(), next_year, 0), 0);
  std::vector<std::string> texts;
  for (const auto& finding : check_computer(&train, train.host("cab"), folder_)) texts.push_back(finding.text);
  EXPECT_THAT(texts, Contains(AllOf(HasSubstr("clock is wrong"), HasSubstr("train.yaml"))));
}

TEST_F(TrainFolder, DisksOfTheRootAndOfRecordingsAreLookedAt) {
  const auto told = [&](const std::string& recorder, const fs::path& root) {
    const auto train = manifest(kTrain, "settings:\n", "settings:\n  recorder: " + recorder + "\n").value();
    std::vector<std::string> texts;
    for (const auto& finding : check_computer(&train, train.host("cab"), root)) texts.push_back(finding.text);
    return texts;
  };
  // Nothing can be written below /proc: it has no room.
  EXPECT_THAT(
      told("{ folder: /proc/recordings }", folder_),
      Contains(AllOf(HasSubstr("/proc has 0 MB free, this host needs 2500 MB there (2000 MB to begin recording"),
                     HasSubstr("recorder.quota_mb is not set"), HasSubstr("recorder.keep_free_mb"))));
  EXPECT_THAT(told("{ folder: recordings, quota_mb: 150, keep_free_mb: 20 }", "/proc/root-of-nobody"),
              Contains(HasSubstr("/proc has 0 MB free, this host needs 370 MB there (200 MB of logs and "
                                 "configurations, 150 MB of recordings up to recorder.quota_mb, 20 MB that")));
  EXPECT_THAT(told("{ folder: recordings }", folder_), Not(Contains(HasSubstr("/proc has"))));
}

TEST_F(TrainFolder, DisksNeedRoomForWhatTheSettingsAllowBesideWhatIsThere) {
  const auto needed_mb = [&](const char* host, const std::string& settings) {
    const auto train = manifest(kTrain, "settings:\n  tpr_publisher:\n", "settings:\n" + settings).value();
    double sum = 0;
    for (const auto& need : disk_needs(train, *train.host(host), folder_)) sum += need.mb;
    return sum;
  };
  const std::string link =
      "  tpr_publisher:\n    ground_link: { broker: b, store: reports.db, store_limit: 1000000 }\n";
  EXPECT_DOUBLE_EQ(needed_mb("cab", "  recorder: { quota_mb: 150, keep_free_mb: 20 }\n  tpr_publisher:\n"), 370);
  EXPECT_DOUBLE_EQ(needed_mb("coach", "  recorder: { quota_mb: 150 }\n  tpr_publisher:\n"), 200) << "records nothing";
  EXPECT_DOUBLE_EQ(needed_mb("coach", link), 456) << "a million reports";
  EXPECT_DOUBLE_EQ(needed_mb("cab", "  recorder: { quota_mb: 150, keep_free_mb: 20 }\n" + link), 626) << "a standby";
  const auto recordings = HostFolder(folder_).home() / "recordings";
  fs::create_directories(recordings);
  std::ofstream(recordings / "re460-042-1.mcap");
  fs::resize_file(recordings / "re460-042-1.mcap", 100'000'000);
  const std::string quota = "  recorder: { folder: recordings, quota_mb: 150, keep_free_mb: 20 }\n  tpr_publisher:\n";
  EXPECT_DOUBLE_EQ(needed_mb("cab", quota), 270);
  std::ofstream(recordings / "re460-042-2.mcap.active");
  fs::resize_file(recordings / "re460-042-2.mcap.active", 50'000'000);
  EXPECT_DOUBLE_EQ(needed_mb("cab", quota), 200) << "an upgrade of a train whose quota is full";
}

TEST_F(TrainFolder, SettingsThatAreNotGivenBeginAsTheServicesSay) {
  EXPECT_EQ(recorder::RecorderConfig{}.keep_free_mb, kUsualKeepFreeMb);
  EXPECT_EQ(recorder::RecorderConfig{}.quota_mb, 0);
  EXPECT_EQ(tpr_publisher::GroundLinkConfig{}.store_limit, kUsualStoreLimit);
}

}  // namespace
}  // namespace railfix::tool
