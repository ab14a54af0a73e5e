#include "monitor/problems.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "core/time.hpp"

namespace railfix::monitor {
namespace {

using ::testing::HasSubstr;
using ::testing::IsEmpty;

constexpr int64_t kNow_ns = 1'700'000'000 * core::kNsPerSecond;

class ProblemsTest : public ::testing::Test {
 protected:
  ProblemsTest() {
    train_.now_ns = kNow_ns;
    train_.watched_since_ns = kNow_ns - 60 * core::kNsPerSecond;
    train_.services = &board_;
    train_.expected = {{"odometry", ""}, {"fusion", ""}};
    for (const char* name : {"odometry", "fusion"}) board_.note(status(name, msg::STATE_ACTIVE), kNow_ns);
    train_.state.emplace();
    train_.state->track_known(1);
    train_.state->over_m(3);
    train_.state->under_m(3);
    TopicNumbers numbers;
    numbers.age_s = 0.02;
    train_.topics.push_back({"odometry_step", numbers, 0.02, true});
  }
  static msg::ServiceStatus status(const std::string& name, uint8_t state, const std::string& reason = "",
                                   const std::string& host = "cab") {
    msg::ServiceStatus made;
    made.service(name);
    made.host(host);
    made.state(state);
    made.reason(reason);
    return made;
  }
  [[nodiscard]] Problem only() const {
    const auto problems = find_problems(train_);
    EXPECT_EQ(problems.size(), 1U);
    return problems.empty() ? Problem{} : problems.front();
  }

  messaging::ServiceBoard board_;
  TrainSeen train_;
};

TEST_F(ProblemsTest, AWellTrainHasNone) {
  EXPECT_THAT(find_problems(train_), IsEmpty());
}

TEST_F(ProblemsTest, NamesServicesThatAreMissingDeadOrDegraded) {
  train_.expected.push_back({"recorder", ""});
  EXPECT_EQ(only().what, "recorder is not there");
  train_.watched_since_ns = kNow_ns;
  EXPECT_THAT(find_problems(train_), IsEmpty()) << "it may still be starting";

  board_.note(status("odometry", msg::STATE_DEGRADED, "the picture is dark"), kNow_ns);
  EXPECT_THAT(only().what, HasSubstr("the picture is dark"));
  EXPECT_EQ(only().level, Level::warning);
  board_.note(status("odometry", msg::STATE_DEGRADED), kNow_ns - messaging::ServiceBoard::kSilentNs);
  board_.note_silence(kNow_ns - messaging::ServiceBoard::kLookNs);
  board_.note_silence(kNow_ns);
  EXPECT_THAT(only().what, HasSubstr("dead or frozen"));
  EXPECT_EQ(only().level, Level::error);
  board_.note(status("odometry", msg::STATE_STOPPED), kNow_ns);
  EXPECT_EQ(only().what, "odometry was stopped");
  EXPECT_EQ(only().level, Level::error) << "the train needs it";
  train_.expected.clear();
  EXPECT_EQ(only().level, Level::warning);
}

TEST_F(ProblemsTest, NamesTheProgramOfAMissingService) {
  train_.expected.push_back({"frame_grabber", ""});
  EXPECT_THAT(only().what_to_do, HasSubstr("railfix-frame-grabber"));
}

TEST_F(ProblemsTest, MissesAStandbyOnItsHost) {
  train_.expected = {Expected::of("odometry"), Expected::of("fusion@cab"), Expected::of("fusion@coach")};
  EXPECT_EQ(only().what, "fusion on coach is not there");
  board_.note(status("fusion", msg::STATE_ACTIVE, "", "coach"), kNow_ns);
  EXPECT_THAT(find_problems(train_), IsEmpty());
  board_.note(status("fusion", msg::STATE_STOPPED, "", "coach"), kNow_ns);
  EXPECT_EQ(only().level, Level::error) << "the other host does not stand in for it";
}

TEST_F(ProblemsTest, AServiceThatMovedIsNoError) {
  board_.note(status("odometry", msg::STATE_STOPPED), kNow_ns);
  EXPECT_EQ(only().level, Level::error);
  board_.note(status("odometry", msg::STATE_ACTIVE, "", "coach"), kNow_ns);
  EXPECT_THAT(only().what, HasSubstr("was stopped"));
  EXPECT_EQ(only().level, Level::warning);
  EXPECT_FALSE(train_.needs({"cab", "odometry"}));
  EXPECT_TRUE(train_.needs({"cab", "fusion"}));
}

// What it is since belongs to the reason that is shown.
TEST_F(ProblemsTest, AnotherReasonIsAnotherProblem) {
  board_.note(status("fusion", msg::STATE_DEGRADED, "no camera for 3 s"), kNow_ns);
  const auto first = only().id;
  board_.note(status("fusion", msg::STATE_DEGRADED, "no camera for 4 s"), kNow_ns);
  EXPECT_EQ(only().id, first);
  board_.note(status("fusion", msg::STATE_DEGRADED, "no camera for 5 s; nothing measures the motion"), kNow_ns);
  EXPECT_NE(only().id, first);
}

TEST_F(ProblemsTest, SaysThatNoPositionComes) {
  train_.state.reset();
  EXPECT_THAT(find_problems(train_), IsEmpty());
  train_.awaited_s = 9;
  EXPECT_THAT(find_problems(train_), IsEmpty()) << "it may still be starting";
  train_.awaited_s = 11;
  EXPECT_EQ(only().what, "No position of this train has been heard yet");
  EXPECT_EQ(only().level, Level::error);
  train_.data_stands = true;
  EXPECT_THAT(find_problems(train_), IsEmpty());
  train_.data_stands = false;
  board_.note(status("fusion", msg::STATE_STOPPED), kNow_ns);
  EXPECT_EQ(only().what, "fusion was stopped") << "one cause, one sentence";
}

// What a dead fusion said last is not so now; that it is silent is said.
TEST_F(ProblemsTest, JudgesNoPositionThatIsOld) {
  train_.state->track_known(0);
  train_.state->integrity(msg::INTEGRITY_UNUSABLE);
  train_.state_behind_s = 3;
  EXPECT_EQ(find_problems(train_).size(), 3U);
  train_.state_age_s = 2.5;
  EXPECT_THAT(find_problems(train_), IsEmpty());
}

// Recorded data waits for its command, for as long as its people like.
TEST_F(ProblemsTest, DataThatWaitsToBeginIsNoErrorAndItsCommandIsNamed) {
  const auto note_since = [this](double s, const msg::ServiceStatus& said) {
    board_.note(said, kNow_ns - core::to_ns(s));
    board_.note(said, kNow_ns);
  };
  train_.state.reset();
  train_.awaited_s = 11;
  note_since(11, status("sensor_gateway", msg::STATE_READY));
  train_.now_ns = kNow_ns - core::to_ns(2);
  EXPECT_THAT(find_problems(train_), IsEmpty()) << "railfix run waits until all are connected";
  train_.now_ns = kNow_ns;
  EXPECT_THAT(only().what_to_do, HasSubstr("railfix tell sensor_gateway start"));
  note_since(11, status("frame_grabber", msg::STATE_READY));
  EXPECT_THAT(only().what, HasSubstr("frame_grabber is ready, and waits to begin"));
  EXPECT_THAT(only().what_to_do, HasSubstr("railfix tell frame_grabber start"));
  EXPECT_EQ(only().level, Level::warning);
  board_.note(status("frame_grabber", msg::STATE_ACTIVE), kNow_ns);
  EXPECT_EQ(only().what, "No position of this train has been heard yet");
  EXPECT_EQ(only().level, Level::error) << "its pictures come";
  board_.note(status("frame_grabber", msg::STATE_STOPPED), kNow_ns);
  EXPECT_THAT(find_problems(train_).back().what, HasSubstr("sensor_gateway is ready"));
}

TEST_F(ProblemsTest, AMonitorWithoutAMapLacksTheMapAndNoTrack) {
  train_.no_map = true;
  train_.state->track_known(0);
  EXPECT_THAT(only().what, HasSubstr("The monitor has no map, and fusion names no place"));
  train_.state->integrity(msg::INTEGRITY_DEGRADED);
  EXPECT_THAT(find_problems(train_).back().what, HasSubstr("held by less than usual")) << "fusion may have one";
  train_.state->edge(3);  // fusion has one
  EXPECT_THAT(find_problems(train_).front().what, HasSubstr("not known which track"));
}

TEST_F(ProblemsTest, GivesFusionsReasonWhyThePositionMustNotBeUsed) {
  train_.state->integrity(msg::INTEGRITY_UNUSABLE);
  EXPECT_EQ(only().what, "The position must not be used");
  board_.note(status("fusion", msg::STATE_DEGRADED, "nothing measures the motion"), kNow_ns);
  EXPECT_EQ(find_problems(train_).back().what, "The position must not be used: nothing measures the motion");
}

TEST_F(ProblemsTest, SaysThatNobodyWasHeardYet) {
  messaging::ServiceBoard empty;
  train_.services = &empty;
  train_.watched_since_ns = kNow_ns;
  EXPECT_THAT(only().what, HasSubstr("No service of this train has been heard yet"));
  empty.note(status("monitor", msg::STATE_ACTIVE), kNow_ns);
  EXPECT_THAT(only().what, HasSubstr("No service")) << "the monitor hears itself";
  empty.note(status("fusion", msg::STATE_ACTIVE), kNow_ns);
  EXPECT_THAT(find_problems(train_), IsEmpty());
}

TEST_F(ProblemsTest, APausedRecordingIsNone) {
  train_.now_ns += 10 * core::kNsPerSecond;
  EXPECT_EQ(find_problems(train_).size(), 2U) << "two services have said nothing for ten seconds";
  train_.data_stands = true;
  EXPECT_THAT(find_problems(train_), IsEmpty());
  train_.played = true;
  train_.expected.push_back({"recorder", ""});
  EXPECT_THAT(find_problems(train_), IsEmpty()) << "a player stands in for all services";
}

TEST_F(ProblemsTest, ASilentTopicIsOneOnlyWhileDataFlows) {
  train_.topics[0].numbers.age_s = 3;
  EXPECT_EQ(only().what, "odometry_step has stopped coming");
  train_.data_stands = true;
  EXPECT_THAT(find_problems(train_), IsEmpty());
  train_.data_stands = false;
  train_.topics[0].written = false;
  EXPECT_THAT(find_problems(train_), IsEmpty()) << "its writer has gone, which is the service's problem";
}

TEST_F(ProblemsTest, TellsWhatIsWrongWithThePosition) {
  train_.state->over_m(90);
  train_.state->under_m(40);
  EXPECT_THAT(only().what, HasSubstr("130 m wide"));
  train_.state->under_m(std::numeric_limits<double>::infinity());
  EXPECT_THAT(only().what, HasSubstr("has no bound"));
  train_.state->under_m(40);
  train_.state->track_known(0);
  EXPECT_THAT(only().what, HasSubstr("not known which track"));
  train_.state->track_known(1);
  train_.state->over_m(1);
  train_.state->integrity(msg::INTEGRITY_UNUSABLE);
  EXPECT_EQ(only().level, Level::error);
}

// A fusion that is seconds behind but publishes steadily is not shown as live.
TEST_F(ProblemsTest, TellsOfAPositionThatIsOldWhenItComes) {
  train_.state_behind_s = 0.9;
  EXPECT_THAT(find_problems(train_), IsEmpty());
  train_.state_behind_s = 3.24;
  EXPECT_THAT(only().what, HasSubstr("3.2 s old"));
  EXPECT_THAT(only().what, HasSubstr("clocks differ"));
  EXPECT_EQ(only().level, Level::error);
  train_.data_stands = true;
  EXPECT_THAT(find_problems(train_), IsEmpty());
}

TEST_F(ProblemsTest, TellsOfCertificatesBeforeTheyRunOut) {
  train_.certificate_days = 20;
  train_.certificates = {{"fusion", "coach", 20}};
  EXPECT_THAT(find_problems(train_), IsEmpty());
  train_.certificates = {{"fusion", "coach", 19}};
  EXPECT_EQ(only().what, "The certificate of fusion on coach runs out in 19 days");
  EXPECT_EQ(only().level, Level::warning);
  train_.certificates = {{"fusion", "coach", -1}};
  EXPECT_EQ(only().what, "The certificate of fusion on coach has run out");
  train_.keys_command = "railfix train keys /home/max/re460-042";
  EXPECT_THAT(only().what_to_do,
              HasSubstr("railfix train keys /home/max/re460-042 --renew, then railfix train upgrade"));
  EXPECT_EQ(only().level, Level::error);
}

TEST_F(ProblemsTest, TellsOfRecorderSatellitesAndSharedMemory) {
  train_.recorder.emplace();
  train_.recorder->state(msg::RECORDER_RECORDING);
  train_.recorder->disk_free_mb(50'000);
  EXPECT_THAT(find_problems(train_), IsEmpty());
  msg::LostSamples lost;
  lost.topic("track_view");
  lost.queue(12);
  train_.recorder->lost({lost});
  EXPECT_THAT(only().what, HasSubstr("12 samples of track_view"));
  board_.note(status("recorder", msg::STATE_DEGRADED, "samples are lost: track_view: 12 queue"), kNow_ns);
  EXPECT_THAT(only().what, HasSubstr("12 samples of track_view")) << "one cause, one sentence";
  board_.note(status("recorder", msg::STATE_ACTIVE), kNow_ns);
  train_.recorder->lost({});
  train_.recorder->disk_free_mb(300);
  EXPECT_THAT(only().what, HasSubstr("300 MB"));
  train_.recorder->disk_free_mb(0);
  EXPECT_THAT(only().what, HasSubstr(" 0 MB"));
  train_.recorder->disk_free_mb(std::nan(""));
  EXPECT_THAT(find_problems(train_), IsEmpty()) << "it cannot be told";
  train_.recorder->state(msg::RECORDER_STOPPED);
  EXPECT_EQ(only().what, "Nothing is being recorded");
  EXPECT_EQ(only().what_to_do, "Start the recorder in its panel.");
  board_.note(status("recorder", msg::STATE_DEGRADED, "the disk is full"), kNow_ns);
  EXPECT_THAT(find_problems(train_).back().what_to_do, HasSubstr("See to what the recorder says"));
  board_.note(status("recorder", msg::STATE_ACTIVE), kNow_ns);
  train_.recorder.reset();
  train_.gnss.emplace();
  train_.gnss->fix(msg::GNSS_NONE);
  EXPECT_THAT(only().what, HasSubstr("no fix"));
  train_.gnss.reset();
  train_.shared_memory_free_mb = 10;
  EXPECT_THAT(only().what, HasSubstr("/dev/shm has 10 MB left"));
}

TEST(ProblemList, RemembersSinceWhenAndPutsTheWorstFirst) {
  ProblemList list;
  const Problem warning{"a", Level::warning, "a", "", 0};
  const Problem error{"b", Level::error, "b", "", 0};
  EXPECT_TRUE(list.update({warning}, 100));
  EXPECT_FALSE(list.update({warning}, 200));
  EXPECT_TRUE(list.update({warning, error}, 300));
  ASSERT_EQ(list.problems().size(), 2U);
  EXPECT_EQ(list.problems()[0].id, "b");
  EXPECT_EQ(list.problems()[1].since_ns, 100);
  EXPECT_TRUE(list.update({}, 400));
  EXPECT_TRUE(list.update({warning}, 500));
  EXPECT_EQ(list.problems()[0].since_ns, 500) << "it had gone meanwhile";
}

}  // namespace
}  // namespace railfix::monitor
