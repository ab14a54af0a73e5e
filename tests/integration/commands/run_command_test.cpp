// Which folders `railfix run` takes, and which it refuses before it begins.
#include <csignal>
#include <thread>

#include "core/csv.hpp"
#include "core/time.hpp"
#include "integration/commands/refusal.hpp"
#include "unit/dataset/temporary_folder.hpp"

namespace railfix {
namespace {

namespace fs = std::filesystem;

constexpr const char* kDomain = "92";

class RunCommand : public testing::TemporaryFolder {
 protected:
  [[nodiscard]] std::string path(const std::string& name) const { return (root_ / name).string(); }
  [[nodiscard]] std::vector<std::string> run(const std::string& source, std::vector<std::string> more = {}) const {
    more.insert(more.begin(), {"railfix", "run", "--dataset", path(source), "--out", path("out"), "--domain", kDomain});
    return more;
  }
};

TEST_F(RunCommand, TwoIntoOneFolderAreNotTaken) {
  for (int second = 0; second < 300; ++second)
    write_picture("pictures/" + std::to_string(1000 + second) + ".png", second % 256);
  test::Program first(run("pictures", {"--fps", "1", "--pace", "real"}), {root_ / "said", {}, {}});
  const auto deadline = std::chrono::steady_clock::now() + std::chrono::duration<double>(kPatienceS);
  while (!fs::exists(root_ / "out/log")) {
    ASSERT_FALSE(first.exit_code()) << test::slurp(root_ / "said");
    ASSERT_LT(std::chrono::steady_clock::now(), deadline);
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
  }
  const auto settings = test::slurp(root_ / "out/run.yaml");
  expect_refusal(test::run_program(run("pictures"), kPatienceS),
                 "--out: another railfix run writes into " + path("out") + " now; wait until it has ended");
  EXPECT_EQ(test::slurp(root_ / "out/run.yaml"), settings) << "which the first one's services read";
  EXPECT_FALSE(first.exit_code()) << test::slurp(root_ / "said");

  first.end(SIGKILL);
  expect_refusal(test::run_program(run("pictures"), kPatienceS),
                 path("out") + " holds a run already; remove it, or give another --out");
  EXPECT_EQ(test::slurp(root_ / "out/run.yaml"), settings);
  fs::remove_all(root_ / "out");
  expect_refusal(test::run_program(run("pictures", {"--start", "1:1"}), kPatienceS), "--start 1:1 needs a map");
}

TEST_F(RunCommand, OneThatIsEndedEarlySaysHowFarItCame) {
  for (int second = 0; second < 300; ++second)
    write_picture("pictures/" + std::to_string(1000 + second) + ".png", second % 256);
  test::Program ended(run("pictures", {"--fps", "1", "--pace", "real"}), {root_ / "said", {}, {}});
  const auto deadline = std::chrono::steady_clock::now() + std::chrono::duration<double>(kPatienceS);
  while (test::slurp(root_ / "said").find("watch it on") == std::string::npos) {
    ASSERT_FALSE(ended.exit_code()) << test::slurp(root_ / "said");
    ASSERT_LT(std::chrono::steady_clock::now(), deadline);
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
  }
  ended.end(SIGTERM);
  EXPECT_EQ(ended.exit_code(), 1);
  const auto said = test::slurp(root_ / "said");
  EXPECT_THAT(said, ::testing::ContainsRegex("interrupted after [0-9]+ of 300 pictures; the rest is missing"));
  EXPECT_THAT(said, ::testing::HasSubstr("tables and recording.mcap are in " + path("out")));
}

TEST_F(RunCommand, WithoutRoomForItsRecordingItDoesNotBegin) {
  write_picture("pictures/1000.png", 100);
  expect_refusal(
      test::run_program(run("pictures", {"--fps", "1", "--set", "recorder.keep_free_mb=10000000"}), kPatienceS),
      path("out") + ": nothing would be recorded, its disk has only ");
  EXPECT_FALSE(fs::exists(root_ / "out"));
}

TEST_F(RunCommand, SettingsThatNoServiceAcceptsLeaveTheFolderFree) {
  write_picture("pictures/1000.png", 100);
  expect_refusal(test::run_program(run("pictures", {"--set", "fusion.interval_factor=nan"}), kPatienceS),
                 "fusion.interval_factor 'nan' is not a number");
  expect_refusal(test::run_program(run("pictures", {"--config", path("pictures")}), kPatienceS), "is a folder");
  EXPECT_FALSE(fs::exists(root_ / "out"));
}

TEST_F(RunCommand, ADatasetOfSensorsAloneIsRunWithoutTheCamerasServices) {
  const auto simulated = test::run_program({"railfix", "simulate", "--no-pictures", "--out", path("seq"), "--start",
                                            "1:250", "--duration-s", "8", "--dwell-s", "1", "--quiet"},
                                           kPatienceS);
  ASSERT_EQ(simulated.exit_code, 0) << simulated.err;
  expect_refusal(test::run_program(run("seq", {"--camera-only"}), kPatienceS), "nothing is left with --camera-only");
  expect_refusal(test::run_program(run("seq", {"--draw", path("drawn")}), kPatienceS),
                 "nothing that --draw could draw on");
  EXPECT_FALSE(fs::exists(root_ / "out"));

  const auto ran = test::run_program(run("seq", {"--start", "1:250:+"}), 4 * kPatienceS);
  ASSERT_EQ(ran.exit_code, 0) << ran.err;
  EXPECT_THAT(ran.err, ::testing::HasSubstr("has no pictures: its sensors are played at the recorded rate"));
  EXPECT_FALSE(fs::exists(root_ / "out/log/track_detector.log"));
  // How many states there are is up to the machine; that they go from the beginning to the end is not.
  auto states = core::value_or_throw(core::CsvReader::open(root_ / "out/train_state.csv"));
  int64_t first_ns = 0;
  int64_t last_ns = 0;
  while (states.next()) {
    last_ns = states.integer(*states.column({"stamp_ns"})).value();
    if (first_ns == 0) first_ns = last_ns;
  }
  EXPECT_GT(last_ns - first_ns, 6 * core::kNsPerSecond);
}

TEST_F(RunCommand, WhereTheRecorderStopsInTheMiddleItIsNoWholeRun) {
  const auto simulated = test::run_program({"railfix", "simulate", "--no-pictures", "--out", path("seq"), "--start",
                                            "1:250", "--duration-s", "20", "--quiet"},
                                           kPatienceS);
  ASSERT_EQ(simulated.exit_code, 0) << simulated.err;
  test::Program ran(run("seq", {"--start", "1:250:+"}), {root_ / "said", root_ / "warned", {}});
  const auto stop = [&] {
    return test::run_program({"railfix", "tell", "recorder", "stop", "--config", path("out/run.yaml")}, kPatienceS);
  };
  auto told = stop();
  for (int again = 0; told.exit_code != 0 && again < 20 && !ran.exit_code(); ++again) told = stop();
  ASSERT_EQ(told.exit_code, 0) << told.err;
  EXPECT_EQ(ran.wait_for_end(), 1) << test::slurp(root_ / "said");
  EXPECT_THAT(test::slurp(root_ / "warned"), ::testing::HasSubstr("the recorder stopped before the data ended"));
}

// The process of this run; -1 = there is none.
pid_t process_of(const std::string& program, const std::string& config) {
  std::error_code gone;
  for (const auto& entry : fs::directory_iterator("/proc")) {
    const auto command = test::slurp(entry.path() / "cmdline");
    if (fs::read_symlink(entry.path() / "exe", gone).filename() == program && command.find(config) != std::string::npos)
      return std::stoi(entry.path().filename());
  }
  return -1;
}

TEST_F(RunCommand, AFrozenServiceIsNamedAndTheTablesAreThere) {
  const auto simulated = test::run_program({"railfix", "simulate", "--no-pictures", "--out", path("seq"), "--start",
                                            "1:250", "--duration-s", "8", "--dwell-s", "1", "--quiet"},
                                           kPatienceS);
  ASSERT_EQ(simulated.exit_code, 0) << simulated.err;
  test::Program ran(run("seq", {"--start", "1:250:+"}), {root_ / "said", root_ / "warned", {}});
  const auto is_said = [&] { return test::slurp(root_ / "said").find("watch it on") != std::string::npos; };
  for (int turn = 0; !is_said() && turn < 900 && !ran.exit_code(); ++turn)
    std::this_thread::sleep_for(std::chrono::milliseconds(100));
  ASSERT_TRUE(is_said()) << test::slurp(root_ / "warned");
  std::this_thread::sleep_for(std::chrono::seconds(2));  // so that there is something in the tables
  const pid_t frozen = process_of("railfix-tpr-publisher", path("out/run.yaml"));
  ASSERT_GT(frozen, 1);
  ASSERT_EQ(kill(frozen, SIGSTOP), 0);
  for (int turn = 0; turn < 900 && !ran.exit_code(); ++turn)
    std::this_thread::sleep_for(std::chrono::milliseconds(100));
  ASSERT_TRUE(ran.exit_code()) << "it waits for good";
  EXPECT_EQ(*ran.exit_code(), 1);
  EXPECT_THAT(test::slurp(root_ / "warned"),
              ::testing::HasSubstr("tpr_publisher said nothing any more before the run ended: dead or frozen"));
  auto states = core::value_or_throw(core::CsvReader::open(root_ / "out/train_state.csv"));
  EXPECT_TRUE(states.next());
}

TEST_F(RunCommand, WhatIsSetStandsInItsConfigurationAsItWasTyped) {
  for (int second = 0; second < 300; ++second)
    write_picture("pictures/" + std::to_string(1000 + second) + ".png", second % 256);
  test::Program ran(run("pictures", {"--fps", "1", "--pace", "real", "--set", "recorder.folder=/data/pics #2"}),
                    {root_ / "said", {}, {}});
  const auto settings = [&] { return test::slurp(root_ / "out/run.yaml"); };
  for (int turn = 0; settings().empty() && turn < 600 && !ran.exit_code(); ++turn)
    std::this_thread::sleep_for(std::chrono::milliseconds(100));
  EXPECT_THAT(settings(), ::testing::HasSubstr("folder: \"/data/pics #2\"")) << test::slurp(root_ / "said");
}

}  // namespace
}  // namespace railfix
